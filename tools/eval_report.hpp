// What bitr eval found: a table for people, JSON of the same, and CSV of every pair.
#pragma once

#include <bitr/confidence.hpp>
#include <bitr/evaluate.hpp>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "output.hpp"

namespace bitr::tool {

/// One pair under one method.
struct EvalPair {
  std::string shape;
  std::size_t sample = 0;
  double overlap = 0;
  PoseErrors errors;
  Pose T_reference_source = {};  ///< that was estimated
  std::optional<Confidence> confidence = {};
};

struct EvalMethod {
  std::string name;
  std::vector<EvalPair> pairs;
  double milliseconds = 0;  ///< that their poses took together, without what was asked about them
};

/// One setting: the same pairs under every method.
struct EvalSetting {
  std::string protocol;
  std::optional<double> share;  ///< what a crop keeps
  std::uint64_t points = 0;     ///< in a cloud, or in the object before the crop
  double keep = 0;              ///< share of the points that ICP keeps
  bool by_overlap = false;      ///< also tell pairs apart by their true overlap
  std::vector<EvalMethod> methods;
};

struct EvalReport {
  std::string data;  ///< what was evaluated, one line for people
  Json about;        ///< the same and the methods, for JSON
  std::vector<EvalSetting> settings;
  std::vector<SkippedShape> skipped;
};

/// A method's pairs, all of them or those in a bin of overlap.
struct EvalRow {
  const EvalSetting& setting;
  std::optional<int> bin;
  std::string method;
  ErrorSummary summary;
  ConfidenceSummary confidence;  ///< no poses where none was judged
  double milliseconds = 0;       ///< a pair, of all the method's
};

/// Setting by setting: its methods, then bin by bin where there are pairs.
std::vector<EvalRow> rows_of(const EvalReport& report);
/// Each judged method's confidences over all settings, in the order of the rows.
std::vector<std::pair<std::string, ConfidenceSummary>> pooled_confidence(const EvalReport& report);
/// "opposed, s = 0.7, 1024 points"
std::string title(const EvalSetting& setting);
/// The same with the bin and the number of pairs.
std::string title(const EvalRow& row);

void print(const EvalReport& report, std::FILE* out);
Json to_json(const EvalReport& report);
std::string to_csv(const EvalReport& report);

}  // namespace bitr::tool
