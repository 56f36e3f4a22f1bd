// What a batch has found so far: a line for every pair, and what they amount to.
#pragma once

#include <bitr/assemble.hpp>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "io/line_log.hpp"
#include "output.hpp"

namespace bitr::tool {

/// Values of any number in fixed memory; the median is exact to one part in 1,000 of `most`.
class Histogram {
 public:
  explicit Histogram(double most) : most_(most), bins_(1001) {}
  void add(double value);
  std::uint64_t count() const { return count_; }
  double median() const;
  double mean() const { return count_ ? sum_ / static_cast<double>(count_) : 0; }
  /// Share of the values that are at most this much.
  double share_within(double value) const;

 private:
  double most_, sum_ = 0;
  std::uint64_t count_ = 0;
  std::vector<std::uint64_t> bins_;
};

struct BatchSummary {
  std::uint64_t pairs = 0, ok = 0, degenerate = 0, failed = 0, unreadable = 0;
  std::uint64_t refused = 0;  ///< so many of those that are ok or degenerate
  Histogram rotation_degrees{180}, overlap{1}, confidence{1};
  void add(const Json& line);
};

/// DIR/results.jsonl: first the settings, then the pairs in the manifest's order.
class BatchResults {
 public:
  /// Takes up what is there; `number`: of the i-th pair. Failure: `io`; `invalid_argument` when it was made
  /// with other settings, is no file of results, or has a line that is not the next pair's. It stays as it is
  /// then.
  BatchResults(const std::string& file, const Json& settings,
               std::function<std::uint64_t(std::uint64_t)> number);

  std::uint64_t done() const { return summary_.pairs; }  ///< pairs that have their line
  const BatchSummary& summary() const { return summary_; }
  /// Failure (`io`): none of the lines is there then.
  void append(const std::vector<Json>& lines);

 private:
  bool take_up(std::string_view line, bool whole);

  BatchSummary summary_;
  const std::string file_, head_;
  const std::function<std::uint64_t(std::uint64_t)> number_;
  bool headed_ = false;
  io::LineLog log_;
};

}  // namespace bitr::tool
