#include "assembly_report.hpp"

#include <algorithm>

#include "options.hpp"
#include "pose_file.hpp"
#include "refinement.hpp"

namespace bitr::tool {
namespace {

void print_network(const AssemblyReport& report, std::FILE* out) {
  const Plan& plan = *report.plan;
  std::fprintf(out, "model       %s, %s, %s%s%s\n", plan.model().name().c_str(),
               mode_name(plan.mode()).data(), precision_name(plan.options().precision).data(),
               plan.options().as_defined ? ", as defined" : "",
               report.complete_match ? ", complete match" : "");
  if (report.answer.answers > 1)
    std::fprintf(out, "answers     mean of %d, for the clouds and for parts of them\n",
                 report.answer.answers);
}

void print_diagnostics(const AssemblyReport& report, std::FILE* out) {
  const Diagnostics& d = report.answer.assembly.diagnostics;
  std::fprintf(out, "status      %s%s%s\n", status_name(report.answer.assembly.status).data(),
               d.reason.empty() ? "" : ": ", d.reason.c_str());
  if (d.overlap && d.inlier_threshold)
    std::fprintf(out, "overlap     %.1f %% of the source within %.4g of the reference\n", 100 * *d.overlap,
                 *d.inlier_threshold);
  if (d.inlier_rmse) std::fprintf(out, "inlier RMSE %.4g\n", *d.inlier_rmse);
  std::fprintf(out, "rotation    gap %.4g in 0 … 2, singular values %.4g %.4g %.4g\n", d.rotation_gap,
               d.singular_values[0], d.singular_values[1], d.singular_values[2]);
  if (d.swap_residual) std::fprintf(out, "swap        residual %.3g\n", *d.swap_residual);
}

void print_verification(const std::vector<StageDifference>& stages, std::FILE* out) {
  std::size_t width = 5;
  for (const StageDifference& stage : stages) width = std::max(width, stage.stage.size());
  std::fprintf(out, "\n%-*s  difference  bound\n", static_cast<int>(width), "stage");
  for (const StageDifference& stage : stages)
    std::fprintf(out, "%-*s  %.2e    %.2e%s\n", static_cast<int>(width), stage.stage.c_str(),
                 stage.difference, stage.bound, stage.within() ? "" : "  BEYOND");
}

Json network_diagnostics(const Diagnostics& d) {
  return {{"singular_values", d.singular_values},
          {"rotation_gap", d.rotation_gap},
          {"inlier_rmse", optional_json(d.inlier_rmse)},
          {"inlier_threshold", optional_json(d.inlier_threshold)},
          {"swap_residual", optional_json(d.swap_residual)}};
}

Json network_json(const AssemblyReport& report) {
  const Plan& plan = *report.plan;
  const Assembly& assembly = report.answer.assembly;
  return {
      {"proposal", plan.model().name()},
      {"model", plan.model().name()},
      {"trained", plan.model().trained()},
      {"complete_match", report.complete_match},
      {"precision", precision_name(plan.options().precision)},
      {"as_defined", plan.options().as_defined},
      {"mode", mode_name(plan.mode())},
      {"key_points", {{"source", assembly.source_key_points}, {"reference", assembly.reference_key_points}}},
      {"answers", report.answer.answers}};
}

}  // namespace

std::string_view status_name(Status status) {
  switch (status) {
    case Status::ok:
      return "ok";
    case Status::degenerate:
      return "degenerate";
    case Status::failed:
      return "failed";
  }
  return "failed";
}

Json diagnostics_json(const Answer& answer) {
  const Diagnostics& d = answer.assembly.diagnostics;
  Json json = {{"status", status_name(answer.assembly.status)},
               {"degenerate", d.degenerate},
               {"reason", d.reason},
               {"overlap", optional_json(d.overlap)}};
  if (!answer.solution) json.update(network_diagnostics(d));
  return json;
}

bool within_bounds(const AssemblyReport& report) {
  return std::all_of(report.verification.begin(), report.verification.end(),
                     [](const StageDifference& stage) { return stage.within(); });
}

void print(const AssemblyReport& report, std::FILE* out) {
  const Answer& answer = report.answer;
  print_matrix(answer.assembly.T_reference_source, out);
  std::fprintf(out, "points      source %zu, reference %zu\n", report.source_points, report.reference_points);
  if (report.plan) print_network(report, out);
  if (answer.restricted) std::fprintf(out, "restricted  to %s\n", describe(*answer.restricted).c_str());
  if (!answer.solution) print_diagnostics(report, out);
  if (answer.refinement) print(*answer.refinement, report.refine_options, out);
  if (answer.solution)
    print(*answer.solution, out);
  else if (answer.confidence)
    print(*answer.confidence, out);
  std::fprintf(out, "time        %.1f ms on %s (%s), %u threads\n", report.total_milliseconds,
               report.device->name().c_str(), name(report.device->backend()).data(),
               report.device->threads());
  if (report.truth)
    std::fprintf(out, "error       rotation %.3g degrees, translation %.3g\n",
                 rotation_error_degrees(report.answer.assembly.T_reference_source, *report.truth),
                 translation_error(report.answer.assembly.T_reference_source, *report.truth));
  if (!report.verification.empty()) print_verification(report.verification, out);
  std::fflush(out);
}

Json to_json(const AssemblyReport& report) {
  const Pose& pose = report.answer.assembly.T_reference_source;
  Json timing = {{"total", report.total_milliseconds}};
  for (const StageTime& stage : report.timings) {
    const std::string key = stage.stage == "graph.index" ? "knn" : stage.stage;
    timing[key] = timing.value(key, 0.0) + stage.milliseconds;
  }

  Json json = pose_json(pose);
  json.update(judgement_json(report.answer));
  if (report.plan) json.update(network_json(report));
  json.update(
      {{"backend", name(report.device->backend())},
       {"device", report.device->name()},
       {"points", {{"source", report.source_points}, {"reference", report.reference_points}}},
       {"restriction", report.answer.restricted ? to_json(*report.answer.restricted) : Json(nullptr)},
       {"diagnostics", diagnostics_json(report.answer)},
       {"refinement", report.answer.refinement ? to_json(*report.answer.refinement, report.refine_options)
                                               : Json(nullptr)}});
  if (report.truth) json["errors"] = errors_json(pose, *report.truth);
  if (!report.verification.empty()) {
    Json stages = Json::array();
    for (const StageDifference& stage : report.verification)
      stages.push_back({{"stage", stage.stage}, {"difference", stage.difference}, {"bound", stage.bound}});
    json["verification"] = std::move(stages);
  }
  json["timing_ms"] = std::move(timing);
  return json;
}

}  // namespace bitr::tool
