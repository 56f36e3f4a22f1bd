// From clouds to an answer that can be acted on: what solve() finds, or the mean of one network's poses; restricted,
// refined and judged as asked.
#pragma once

#include <bitr/assemble.hpp>
#include <bitr/confidence.hpp>
#include <bitr/refine.hpp>
#include <bitr/solve.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cli.hpp"
#include "cloud_input.hpp"
#include "refinement.hpp"
#include "restriction.hpp"

namespace bitr::tool {

struct AnswerChoice {
  RefineChoice refine;
  Restriction restriction;
  std::optional<int> answers;  ///< for parts of the clouds; by `judge_unless_told` unless given
  bool judge_unless_told = false;
  bool confidence = false;
  bool strict = false;
  double least_confidence = 0.5;
};

/// For parts of the clouds, unless told otherwise: as many as confidence was calibrated with.
inline constexpr int usual_answers = ResampleOptions().answers;
/// --answers, for any command.
void add_answers(CLI::App& app, std::optional<int>& answers, const std::string& unless_given);
/// `invalid_argument` when resample() cannot be asked for so many; 0 is allowed.
Result<void> check_answers(int answers);

/// --answers, --refine and its options, --translation-only, --yaw-only, --strict, --least-confidence, and the
/// flag that turns judging on where it is off, or off where it is on.
void add_answer_options(CLI::App& app, AnswerChoice& choice, bool judge_unless_told);
/// What answers depend on beside the network, for settings.
Json to_json(const AnswerChoice& choice);

/// What is done with every pair.
struct AnswerOptions {
  bool complete_match = false;
  bool swap_residual = false;  ///< see AssembleOptions
  int answers = 0;             ///< for parts of the clouds; the pose is the mean of all
  Restriction restriction = {};
  std::optional<RefineOptions> refine = {};
  bool confidence = false;
};
/// Without complete matching, whatever the model. `invalid_argument` names the option.
Result<AnswerOptions> answer_options(const AnswerChoice& choice);

struct Answer {
  Assembly assembly;  ///< its pose is the last one
  int answers = 1;    ///< whose mean the network's pose is
  std::optional<Restricted> restricted = {};
  std::optional<Refinement> refinement = {};
  std::optional<Confidence> confidence = {};  ///< 0 where the pose is not determined
  std::optional<Solution> solution = {};      ///< what solve() said, if it was asked
};

struct InputPair {
  const CloudInput &source, &reference;
  CloudPair used() const { return {source.used, reference.used}; }
  /// With what solve() takes besides.
  CloudPair seen() const {
    const auto points = [](const CloudInput& input) -> const PointCloud& {
      return input.used.positions.empty() ? input.cloud : input.used;
    };
    return {points(source), points(reference), source.viewpoint, reference.viewpoint};
  }
};

/// One network's: it sees the points chosen for it, refinement all of them. Errors as of assemble(), refine_poses() and
/// judge_poses().
Result<std::vector<Answer>> answer(Plan& plan, std::span<const InputPair> pairs,
                                   const AnswerOptions& options);

/// By solve(). Errors as of solve() and refine_poses().
Result<std::vector<Answer>> solve_pairs(const Device& device, std::span<const InputPair> pairs,
                                        const AnswerOptions& options);

/// Why --strict refuses the answer; empty when it does not.
std::string refusal(const Answer& answer, const AnswerChoice& choice);

/// Lines of the report.
void print(const Confidence& confidence, std::FILE* out);
void print(const Solution& solution, std::FILE* out);
/// `confidence` and what it is about, `reasons`, `evidence`, `proposal` and `alternatives`, and of a solution the lengths
/// it worked with.
Json judgement_json(const Answer& answer);

}  // namespace bitr::tool
