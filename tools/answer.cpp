#include "answer.hpp"

#include <CLI/CLI.hpp>
#include <cmath>

#include "api/internal.hpp"
#include "api/plan.hpp"
#include "core/centroid.hpp"
#include "core/thread_pool.hpp"
#include "options.hpp"
#include "pose_file.hpp"

namespace bitr::tool {
namespace {

std::vector<CloudPair> used(std::span<const InputPair> pairs) {
  std::vector<CloudPair> result;
  for (const InputPair& pair : pairs) result.push_back(pair.used());
  return result;
}

// Those of a rigid family are restricted one by one: each has a centroid of its own.
Result<void> refine(const Device& device, std::span<const InputPair> pairs, const AnswerOptions& options,
                    std::vector<Answer>& answers) {
  const auto refine_some = [&](const std::vector<std::size_t>& rows,
                               const RefineOptions& how) -> Result<void> {
    std::vector<CloudPair> clouds;
    std::vector<Pose> starts;
    for (const std::size_t i : rows) {
      clouds.push_back({pairs[i].source.cloud, pairs[i].reference.cloud});
      starts.push_back(answers[i].assembly.T_reference_source);
    }
    auto refined = refine_poses(device, clouds, starts, how);
    if (!refined) return tl::unexpected(refined.error());
    for (std::size_t k = 0; k < rows.size(); ++k) {
      Answer& answer = answers[rows[k]];
      answer.assembly.T_reference_source = (*refined)[k].T_reference_source;
      answer.refinement = std::move((*refined)[k]);
    }
    return {};
  };
  std::vector<std::size_t> rows;
  for (std::size_t i = 0; i < pairs.size(); ++i)
    if (answers[i].assembly.status != Status::failed) rows.push_back(i);
  if (!options.restriction.any()) return rows.empty() ? Result<void>() : refine_some(rows, *options.refine);
  for (const std::size_t i : rows) {
    const Vec3d centroid = centroid_of(pairs[i].source.cloud.positions);
    RefineOptions how = *options.refine;
    how.within = [&](const Pose& pose) { return restricted(options.restriction, pose, centroid).pose; };
    if (const auto refined = refine_some({i}, how); !refined) return refined;
    follow(answers[i].assembly.T_reference_source, centroid, *answers[i].restricted);
  }
  return {};
}

Result<void> judge(const Device& device, std::span<const CloudPair> clouds,
                   std::span<const std::optional<NetworkEvidence>> evidence, std::vector<Answer>& answers) {
  std::vector<Pose> poses;
  for (const Answer& answer : answers) poses.push_back(answer.assembly.T_reference_source);
  auto judged = judge_poses(device, clouds, poses, evidence);
  if (!judged) return tl::unexpected(judged.error());
  for (std::size_t i = 0; i < answers.size(); ++i) {
    Confidence& confidence = (*judged)[i];
    // So it is with complete matching, with a restriction, and with a network that is sure of parts only.
    if (answers[i].assembly.status == Status::degenerate && confidence.value > 0) {
      confidence.value = 0;
      confidence.reasons.insert(confidence.reasons.begin(), answers[i].assembly.diagnostics.reason);
    }
    answers[i].confidence = std::move(confidence);
  }
  return {};
}

int answers_of(const AnswerChoice& choice) {
  const bool usual = choice.judge_unless_told || choice.confidence || choice.strict;
  return choice.answers.value_or(usual ? usual_answers : 0);
}

// What a network's confidence is about, see Confidence::value.
constexpr double network_degrees = 20, network_share = 0.1;

Json within_json(double degrees, double share) {
  return {{"rotation_degrees", degrees}, {"translation_share", share}};
}

Json evidence_json(const Evidence& e) {
  return {{"score", e.score},
          {"overlap", e.overlap},
          {"rims", optional_json(e.rims)},
          {"interpenetration", e.interpenetration},
          {"rotation_gap", optional_json(e.rotation_gap)},
          {"rotation_spread", optional_json(e.rotation_spread)},
          {"translation_spread", optional_json(e.translation_spread)},
          {"refined_by", optional_json(e.refined_by)}};
}

Json evidence_json(const SolveEvidence& e) {
  return {{"score", e.score},
          {"overlap", {{"source", e.source_overlap}, {"reference", e.reference_overlap}}},
          {"residual", e.residual},
          {"normals", e.normals},
          {"conflict", e.conflict},
          {"slack", e.slack},
          {"margin", e.margin},
          {"support", e.support}};
}

Json judged_json(const SolvedPose& pose) {
  return {{"confidence", pose.confidence},
          {"within", within_json(pose.within_degrees, pose.within_share)},
          {"evidence", evidence_json(pose.evidence)},
          {"proposal", pose.proposal}};
}

std::string value_text(double value) { return Json(std::round(value * 1e4) / 1e4).dump(); }

}  // namespace

void add_answers(CLI::App& app, std::optional<int>& answers, const std::string& unless_given) {
  app.add_option(
         "--answers", answers,
         "Passes over random parts of the clouds, an even number: the network's pose is the mean of "
         "all its answers, and how far they lie apart tells how sure it is; 0: one pass over the clouds")
      ->type_name("N")
      ->default_str(unless_given);
}

Result<void> check_answers(int answers) {
  if (answers >= 0 && answers <= 100 && answers % 2 == 0) return {};
  return fail(ErrorCode::invalid_argument,
              "--answers " + std::to_string(answers) + ": is not an even number in 0 … 100");
}

void add_answer_options(CLI::App& app, AnswerChoice& choice, bool judge_unless_told) {
  choice.judge_unless_told = judge_unless_told;
  const std::string usual = std::to_string(usual_answers);
  add_answers(app, choice.answers, judge_unless_told ? usual : "0, or " + usual + " with --confidence");
  add_choice<std::optional<RefineMethod>>(
      app, "--refine", {{"none", std::nullopt}, {"icp", RefineMethod::icp}, {"ot", RefineMethod::transport}},
      choice.refine.method,
      "Refine the pose on all points, by iterated closest points or optimal transport, and keep "
      "the "
      "better of the two; see bitr refine")
      ->expected(0, 1)
      ->default_str("icp");
  add_refine_options(app, choice.refine, "default");
  add_restriction_options(app, choice.restriction);
  choice.confidence = judge_unless_told;
  app.add_flag_callback(
      judge_unless_told ? "--no-confidence" : "--confidence",
      [&choice, judge_unless_told] { choice.confidence = !judge_unless_told; },
      judge_unless_told ? "Do not estimate how far the pose can be trusted"
                        : "Estimate how far each pose can be trusted");
  auto* strict = app.add_flag(
      "--strict", choice.strict,
      "Refuse a pose that is not determined, or has less confidence than --least-confidence, and clouds "
      "with points that are not finite, which are left out otherwise");
  if (judge_unless_told) strict->excludes("--no-confidence");
  app.add_option("--least-confidence", choice.least_confidence, "What --strict asks for, 0 … 1")
      ->needs(strict)
      ->type_name("P")
      ->capture_default_str();
}

Json to_json(const AnswerChoice& choice) {
  Json json = {{"answers", answers_of(choice)},
               {"confidence", choice.confidence || choice.strict},
               {"least_confidence", choice.strict ? Json(choice.least_confidence) : Json(nullptr)},
               {"refine", choice.refine.method ? Json(name(*choice.refine.method)) : Json(nullptr)}};
  if (choice.refine.method) {
    json["protocol"] = choice.refine.protocol ? Json(name(*choice.refine.protocol)) : Json(nullptr);
    json["keep"] = optional_json(choice.refine.keep);
    json["least_overlap"] = optional_json(choice.refine.least_overlap);
    json["iterations"] = optional_json(choice.refine.iterations);
  }
  if (choice.restriction.any()) json["restriction"] = to_json(choice.restriction);
  return json;
}

Result<AnswerOptions> answer_options(const AnswerChoice& choice) {
  if (!(choice.least_confidence >= 0 && choice.least_confidence <= 1))
    return fail(ErrorCode::invalid_argument,
                "--least-confidence " + Json(choice.least_confidence).dump() + ": is not in 0 … 1");
  auto refine = refine_options(choice.refine, RefineProtocol::adaptive);
  if (!refine) return tl::unexpected(refine.error());
  if (const auto checked = check_answers(answers_of(choice)); !checked)
    return tl::unexpected(checked.error());
  AnswerOptions options{.answers = answers_of(choice),
                        .restriction = choice.restriction,
                        .confidence = choice.confidence || choice.strict};
  if (choice.refine.method) options.refine = std::move(*refine);
  return options;
}

Result<std::vector<Answer>> answer(Plan& plan, std::span<const InputPair> pairs,
                                   const AnswerOptions& options) {
  const std::vector<CloudPair> clouds = used(pairs);
  auto assemblies = assemble(plan, clouds,
                             {.complete_match = options.complete_match,
                              .diagnostics = false,  // measured at the last pose, below
                              .swap_residual = options.swap_residual});
  if (!assemblies) return tl::unexpected(assemblies.error());
  std::vector<std::optional<NetworkEvidence>> evidence(pairs.size());
  if (options.answers > 0 && !options.complete_match) {
    auto found = resample(plan, clouds, *assemblies, {.answers = options.answers});
    if (!found) return tl::unexpected(found.error());
    evidence = std::move(*found);
  }

  std::vector<Answer> answers;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    Answer answer{std::move((*assemblies)[i])};
    if (evidence[i]) {
      answer.assembly.T_reference_source = evidence[i]->T_reference_source;
      answer.answers += options.answers;
    }
    if (options.restriction.any() && answer.assembly.status != Status::failed)
      answer.restricted = restrict_assembly(options.restriction, centroid_of(pairs[i].source.cloud.positions),
                                            answer.assembly);
    if (evidence[i]) evidence[i]->T_reference_source = answer.assembly.T_reference_source;
    answers.push_back(std::move(answer));
  }
  if (options.refine)
    if (const auto refined = refine(plan.device(), pairs, options, answers); !refined)
      return tl::unexpected(refined.error());
  for (std::size_t i = 0; i < pairs.size(); ++i)
    if (Assembly& assembly = answers[i].assembly; assembly.status != Status::failed)
      measure_overlap(clouds[i], assembly.T_reference_source, Internal::pool(plan.device()),
                      assembly.diagnostics);
  if (options.confidence)
    if (const auto judged = judge(plan.device(), clouds, evidence, answers); !judged)
      return tl::unexpected(judged.error());
  return answers;
}

Result<std::vector<Answer>> solve_pairs(const Device& device, std::span<const InputPair> pairs,
                                        const AnswerOptions& options) {
  std::vector<CloudPair> clouds;
  for (const InputPair& pair : pairs) clouds.push_back(pair.seen());
  auto solutions = solve(device, clouds, {.answers = options.answers, .restriction = options.restriction});
  if (!solutions) return tl::unexpected(solutions.error());
  std::vector<Answer> answers;
  for (std::size_t i = 0; i < solutions->size(); ++i) {
    Solution& solution = (*solutions)[i];
    solution.source_dropped += pairs[i].source.holes;
    solution.reference_dropped += pairs[i].reference.holes;
    Answer answer;
    const SolvedPose& best = solution.best;
    answer.assembly.T_reference_source = best.T_reference_source;
    answer.assembly.diagnostics.overlap = best.evidence.source_overlap;
    answer.restricted = solution.restricted;
    answer.confidence = Confidence{best.confidence, solution.reasons, {}};
    if (!(best.confidence > 0)) {
      answer.assembly.status = Status::degenerate;
      answer.assembly.diagnostics.degenerate = true;
      if (!solution.reasons.empty()) answer.assembly.diagnostics.reason = solution.reasons.front();
    }
    answer.solution = std::move(solution);
    answers.push_back(std::move(answer));
  }
  if (options.refine)
    if (const auto refined = refine(device, pairs, options, answers); !refined)
      return tl::unexpected(refined.error());
  return answers;
}

std::string refusal(const Answer& answer, const AnswerChoice& choice) {
  if (!choice.strict) return {};
  if (answer.assembly.status != Status::ok)
    return "the pose is not determined: " + answer.assembly.diagnostics.reason;
  if (!answer.confidence || answer.confidence->value >= choice.least_confidence) return {};
  std::string why = "confidence " + value_text(answer.confidence->value) + " is below " +
                    value_text(choice.least_confidence);
  for (const std::string& reason : answer.confidence->reasons) why += "; " + reason;
  return why;
}

void print(const Confidence& confidence, std::FILE* out) {
  std::fprintf(out, "confidence  %.2f that the pose is within %g° and %g %% of the size\n", confidence.value,
               network_degrees, 100 * network_share);
  for (const std::string& reason : confidence.reasons) std::fprintf(out, "            %s\n", reason.c_str());
}

void print(const Solution& solution, std::FILE* out) {
  const SolvedPose& best = solution.best;
  std::fprintf(out, "overlap     %ld %% of the source, %ld %% of the reference, at a resolution of %.3g\n",
               std::lround(100 * best.evidence.source_overlap),
               std::lround(100 * best.evidence.reference_overlap), solution.resolution);
  if (solution.source_dropped + solution.reference_dropped > 0)
    std::fprintf(out, "dropped     %zu points of the source, %zu of the reference: not finite\n",
                 solution.source_dropped, solution.reference_dropped);
  if (!best.proposal.empty()) std::fprintf(out, "proposed    by %s\n", best.proposal.c_str());
  std::fprintf(out, "confidence  %.2f that the pose is within %g° and %g %% of the size\n", best.confidence,
               best.within_degrees, 100 * best.within_share);
  for (const std::string& reason : solution.reasons) std::fprintf(out, "            %s\n", reason.c_str());
  for (const SolvedPose& other : solution.alternatives)
    if (other.confidence >= 0.01)
      std::fprintf(out, "another     %.2f, turned by %.0f° against it\n", other.confidence,
                   rotation_error_degrees(other.T_reference_source, best.T_reference_source));
}

Json judgement_json(const Answer& answer) {
  if (answer.solution) {
    const Solution& solution = *answer.solution;
    Json json = judged_json(solution.best);
    json["reasons"] = solution.reasons;
    json["alternatives"] = Json::array();
    for (const SolvedPose& other : solution.alternatives) {
      Json alternative = pose_json(other.T_reference_source);
      alternative.update(judged_json(other));
      json["alternatives"].push_back(std::move(alternative));
    }
    json["spacing"] = {{"source", solution.source_spacing}, {"reference", solution.reference_spacing}};
    json["resolution"] = solution.resolution;
    json["dropped"] = {{"source", solution.source_dropped}, {"reference", solution.reference_dropped}};
    return json;
  }
  if (!answer.confidence) return {{"confidence", nullptr}};
  return {{"confidence", answer.confidence->value},
          {"within", within_json(network_degrees, network_share)},
          {"evidence", evidence_json(answer.confidence->evidence)},
          {"reasons", answer.confidence->reasons},
          {"alternatives", Json::array()}};
}

}  // namespace bitr::tool
