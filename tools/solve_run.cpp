#include "solve_run.hpp"

#include <bitr/io.hpp>
#include <bitr/solve.hpp>
#include <cmath>

#include "command.hpp"
#include "io/formats.hpp"
#include "joined_cloud.hpp"
#include "output.hpp"
#include "pose_file.hpp"
#include "stopwatch.hpp"

namespace bitr::tool {
namespace {

Json to_json(const SolveEvidence& e) {
  return {{"score", e.score},
          {"overlap", {{"source", e.source_overlap}, {"reference", e.reference_overlap}}},
          {"residual", e.residual},
          {"normals", e.normals},
          {"conflict", e.conflict},
          {"slack", e.slack},
          {"margin", e.margin},
          {"support", e.support}};
}

Json to_json(const SolvedPose& pose) {
  Json json = pose_json(pose.T_reference_source);
  json["confidence"] = pose.confidence;
  json["proposal"] = pose.proposal;
  json["evidence"] = to_json(pose.evidence);
  return json;
}

Json to_json(const Solution& solution, double milliseconds) {
  Json json = to_json(solution.best);
  json["reasons"] = solution.reasons;
  json["alternatives"] = Json::array();
  for (const SolvedPose& other : solution.alternatives) json["alternatives"].push_back(to_json(other));
  json["spacing"] = {{"source", solution.source_spacing}, {"reference", solution.reference_spacing}};
  json["resolution"] = solution.resolution;
  json["dropped"] = {{"source", solution.source_dropped}, {"reference", solution.reference_dropped}};
  json["timing_ms"] = {{"total", milliseconds}};
  return json;
}

void print(const Solution& solution, double milliseconds, std::FILE* out) {
  print_matrix(solution.best.T_reference_source, out);
  const SolveEvidence& e = solution.best.evidence;
  std::fprintf(out, "overlap     %ld %% of the source, %ld %% of the reference, at a resolution of %.3g\n",
               std::lround(100 * e.source_overlap), std::lround(100 * e.reference_overlap),
               solution.resolution);
  std::fprintf(out, "confidence  %.2f that the pose is within 5° and a twentieth of the size\n",
               solution.best.confidence);
  for (const std::string& reason : solution.reasons) std::fprintf(out, "            %s\n", reason.c_str());
  for (const SolvedPose& other : solution.alternatives)
    if (other.confidence >= 0.01)
      std::fprintf(out, "another     %.2f, turned by %.0f° against it\n", other.confidence,
                   rotation_error_degrees(other.T_reference_source, solution.best.T_reference_source));
  std::fprintf(out, "time        %.1f ms\n", milliseconds);
  std::fflush(out);
}

Result<void> write_outputs(const SolveRun& run, const PointCloud& source, const PointCloud& reference,
                           const Solution& solution, double milliseconds) {
  const Pose& T = solution.best.T_reference_source;
  const auto cloud = [&](const std::string& path) {
    return io::ply_file(path, joined_cloud(source, reference, T));
  };
  const auto applied = [&](const std::string& path) { return io::moved_file(run.source, path, T); };
  const auto image = [&](const std::string&) {
    Assembly assembly;
    assembly.T_reference_source = T;
    return picture_of(source, reference, assembly);
  };
  return write_files({{run.output, cloud},
                      {run.applied, applied},
                      pose_writer(run.pose, T),
                      {run.image, image},
                      json_writer(run.json, to_json(solution, milliseconds))});
}

}  // namespace

int run_solve(const SolveRun& run) {
  const auto truth = read_optional_pose(run.truth);
  if (!truth) return complain(truth.error());
  show_progress("reading");
  const Stopwatch total;
  auto source = read_input(run.source, run.clouds);
  if (!source) return complain(source.error());
  auto reference = read_input(run.reference, run.clouds);
  if (!reference) return complain(reference.error());
  show_progress("solving");
  const auto device = open_device(run.device, true);
  if (!device) return complain(device.error());
  const std::string which = "source " + run.source + ", reference " + run.reference + ": ";
  const CloudPair pair = {source->cloud, reference->cloud};
  const auto solutions = solve(**device, {&pair, 1});
  if (!solutions) return complain(solutions.error(), which);
  const Solution& solution = solutions->front();
  const double milliseconds = total.milliseconds();
  clear_progress();
  std::FILE* out = run.json == "-" ? stderr : stdout;
  print(solution, milliseconds, out);
  if (*truth)
    std::fprintf(out, "error       rotation %.3g degrees, translation %.3g\n",
                 rotation_error_degrees(solution.best.T_reference_source, **truth),
                 translation_error(solution.best.T_reference_source, **truth));
  if (run.least_confidence && solution.best.confidence < *run.least_confidence) {
    std::string why = "confidence " + Json(std::round(solution.best.confidence * 1e4) / 1e4).dump() +
                      " is below " + Json(*run.least_confidence).dump();
    for (const std::string& reason : solution.reasons) why += "; " + reason;
    return complain(run_failed, which + why + "; nothing was written");
  }
  const auto written = write_outputs(run, source->cloud, reference->cloud, solution, milliseconds);
  return written ? done : complain(written.error());
}

}  // namespace bitr::tool
