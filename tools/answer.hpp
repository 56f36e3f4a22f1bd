// From clouds to an answer that can be acted on: the network's pose, restricted, refined and judged as asked.
#pragma once

#include <CLI/CLI.hpp>
#include <bitr/assemble.hpp>
#include <bitr/confidence.hpp>
#include <bitr/refine.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cloud_input.hpp"
#include "refinement.hpp"
#include "restriction.hpp"

namespace bitr::tool {

struct AnswerChoice {
  RefineChoice refine;
  Restriction restriction;
  bool confidence = false;
  bool strict = false;
  double least_confidence = 0.5;
};

/// --refine and its options, --translation-only, --yaw-only, --strict, --least-confidence, and the flag that
/// turns judging on where it is off, or off where it is on.
void add_answer_options(CLI::App& app, AnswerChoice& choice, bool judge_unless_told);
/// What answers depend on beside the network, for settings.
Json to_json(const AnswerChoice& choice);

/// What is done with every pair.
struct AnswerOptions {
  bool complete_match = false;
  bool swap_residual = false;  ///< see AssembleOptions
  Restriction restriction = {};
  std::optional<RefineOptions> refine = {};
  bool confidence = false;
};
/// Without complete matching, whatever the model. `invalid_argument` names the option.
Result<AnswerOptions> answer_options(const AnswerChoice& choice);

struct Answer {
  Assembly assembly;  ///< its pose is the last one
  std::optional<Restricted> restricted = {};
  std::optional<Refinement> refinement = {};
  std::optional<Confidence> confidence = {};  ///< 0 where the pose is not determined
};

struct InputPair {
  const CloudInput &source, &reference;
  CloudPair used() const { return {source.used, reference.used}; }
};

/// The network sees the points chosen for it, refinement all of them. Errors as of assemble(), refine_poses()
/// and judge_poses().
Result<std::vector<Answer>> answer(Plan& plan, std::span<const InputPair> pairs,
                                   const AnswerOptions& options);

/// Why --strict refuses the answer; empty when it does not.
std::string refusal(const Answer& answer, const AnswerChoice& choice);

/// Lines of the report.
void print(const Confidence& confidence, std::FILE* out);
Json to_json(const Confidence& confidence);

}  // namespace bitr::tool
