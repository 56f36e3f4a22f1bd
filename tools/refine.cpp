// bitr refine: from a pose that is about right to one that fits.
#include <CLI/CLI.hpp>
#include <bitr/io.hpp>
#include <bitr/refine.hpp>
#include <memory>

#include "cloud_input.hpp"
#include "command.hpp"
#include "core/centroid.hpp"
#include "device_choice.hpp"
#include "io/formats.hpp"
#include "joined_cloud.hpp"
#include "options.hpp"
#include "output.hpp"
#include "pose_file.hpp"
#include "refinement.hpp"
#include "restriction.hpp"
#include "stopwatch.hpp"

namespace bitr::tool {
namespace {

struct RefineCommandOptions {
  std::string source, reference, pose = "identity", output, applied, pose_out, json, truth;
  RefineChoice choice;
  Restriction restriction;
  CloudOptions clouds;
  DeviceChoice device;

  /// The start's file; empty: the identity.
  std::string start() const { return pose == "identity" ? "" : pose; }
};

Result<PointCloud> read(const std::string& path, const CloudOptions& options) {
  auto input = read_input(path, options);
  if (!input) return tl::unexpected(input.error());
  if (input->holes > 0) warn_of_holes(*input);
  if (input->bare > 0) {
    warn(path + ": " + std::to_string(input->bare) + " points have no normal; none is used");
    input->cloud.normals.clear();
  }
  return options.points ? io::subsample(input->cloud, *options.points, options.seed)
                        : std::move(input->cloud);
}

Result<void> check_own_outputs(const RefineCommandOptions& options) {
  return tool::check_outputs({{"--output", options.output, "a cloud"},
                              {"--applied", options.applied, "a cloud"},
                              {"--pose-out", options.pose_out, "a pose"},
                              {"--json", options.json}},
                             {options.source, options.reference, options.truth, options.start()});
}

void print_result(const Refinement& result, const RefineOptions& how, const std::optional<Restricted>& end,
                  const std::optional<Pose>& truth, std::FILE* out) {
  print_matrix(result.T_reference_source, out);
  if (end) std::fprintf(out, "restricted  to %s\n", describe(*end).c_str());
  print(result, how, out);
  if (truth)
    std::fprintf(out, "error       rotation %.3g → %.3g degrees, translation %.3g → %.3g\n",
                 rotation_error_degrees(result.start, *truth),
                 rotation_error_degrees(result.T_reference_source, *truth),
                 translation_error(result.start, *truth),
                 translation_error(result.T_reference_source, *truth));
  std::fflush(out);
}

Json result_json(const RefineCommandOptions& options, const Refinement& result, const RefineOptions& how,
                 const CloudPair& pair, const Device& device, const std::optional<Restricted>& end,
                 const std::optional<Pose>& truth, double milliseconds) {
  const Pose& pose = result.T_reference_source;
  Json json = {{"source", options.source}, {"reference", options.reference}};
  json.update(pose_json(pose));
  json.update(
      {{"backend", name(device.backend())},
       {"device", device.name()},
       {"points", {{"source", pair.source.positions.count}, {"reference", pair.reference.positions.count}}},
       {"restriction", end ? to_json(*end) : Json(nullptr)},
       {"refinement", to_json(result, how)}});
  if (truth) json["errors"] = errors_json(pose, *truth);
  json["timing_ms"] = {{"total", milliseconds}};
  return json;
}

int run(const RefineCommandOptions& options) {
  if (const auto checked = check_own_outputs(options); !checked) return complain(checked.error());
  if (const auto checked = check_applied(options.source, options.applied); !checked)
    return complain(checked.error());
  auto how = refine_options(options.choice, RefineProtocol::official);
  if (!how) return complain(how.error());
  const auto given = read_optional_pose(options.start());
  if (!given) return complain(given.error());
  Pose start = given->value_or(Pose{});
  const auto truth = read_optional_pose(options.truth);
  if (!truth) return complain(truth.error());

  set_at_hand("source " + options.source + ", reference " + options.reference);
  show_progress("reading");
  const Stopwatch total;
  const auto source = read(options.source, options.clouds);
  if (!source) return complain(source.error());
  const auto reference = read(options.reference, options.clouds);
  if (!reference) return complain(reference.error());

  const Vec3d centroid = centroid_of(source->positions);
  std::optional<Restricted> end;
  if (options.restriction.any()) {
    end = restricted(options.restriction, start, centroid);
    if (!end->problem().empty()) return complain(bad_usage, "--pose " + options.pose + ": " + end->problem());
    start = end->pose;
    how->within = [&](const Pose& pose) { return restricted(options.restriction, pose, centroid).pose; };
  }

  show_progress("refining");
  set_at_hand("source " + options.source + " (" + std::to_string(source->size()) + " points), reference " +
              options.reference + " (" + std::to_string(reference->size()) + " points)");
  const auto device = open_device(options.device);
  if (!device) return complain(device.error());
  const CloudPair pair = {*source, *reference};
  const auto refined = refine_poses(**device, {&pair, 1}, {&start, 1}, *how);
  if (!refined)
    return complain(refined.error(), "source " + options.source + ", reference " + options.reference + ": ");
  device->save_cache();
  const Refinement& result = refined->front();
  const double milliseconds = total.milliseconds();
  clear_progress();

  if (end) follow(result.T_reference_source, centroid, *end);
  print_result(result, *how, end, *truth, options.json == "-" ? stderr : stdout);
  const auto cloud = [&](const std::string& path) {
    return io::ply_file(path, joined_cloud(*source, *reference, result.T_reference_source));
  };
  const auto applied = [&](const std::string& path) {
    return io::moved_file(options.source, path, result.T_reference_source);
  };
  const auto written =
      write_files({{options.output, cloud},
                   {options.applied, applied},
                   pose_writer(options.pose_out, result.T_reference_source),
                   json_writer(options.json, result_json(options, result, *how, pair, **device, end, *truth,
                                                         milliseconds))});
  return written ? done : complain(written.error());
}

}  // namespace

Command add_refine(CLI::App& root) {
  auto options = std::make_shared<RefineCommandOptions>();
  CLI::App* app = add_command(root, "refine", "Refine a pose that is about right; never to a worse one");
  app->add_option("SOURCE", options->source, "Cloud or mesh to be moved")->required()->type_name("FILE");
  app->add_option("REFERENCE", options->reference, "Cloud or mesh that stays")->required()->type_name("FILE");
  app->add_option(
         "--pose,--init", options->pose,
         "The start: T_reference_source in a JSON file of bitr assemble or bitr generate, or 4x4 numbers")
      ->type_name("FILE|identity")
      ->default_str("identity");
  add_choice<RefineMethod>(*app, "--method", {{"icp", RefineMethod::icp}, {"ot", RefineMethod::transport}},
                           options->choice.method, "Iterated closest points, or optimal transport")
      ->default_str("icp");
  add_refine_options(*app, options->choice, "official");
  add_restriction_options(*app, options->restriction);
  app->add_option("-o,--output", options->output, "Write both clouds, joined, to this PLY file")
      ->type_name("FILE");
  add_pose_outputs(*app, options->applied, "--pose-out", options->pose_out);
  add_json(*app, options->json);
  app->add_option("--truth", options->truth, "Compare with the true pose in this JSON file")
      ->type_name("FILE");
  add_count(*app, "--points", options->clouds.points, 1, most_points,
            "Points to sample from a mesh (2048 unless given), and the most to use of a cloud");
  add_seed(*app, "--seed", options->clouds.seed, "Seed of that sampling");
  add_device_options(*app, options->device);
  app->footer(
      "The pose with the better score is kept: 1 - min(1, (d/τ)² + |n - n'|²), averaged over the points of\n"
      "both clouds; d: distance to the other cloud, τ: three spacings of 512 points, n: the normals if both\n"
      "clouds have them.\n"
      "Restricted, the start and the refined pose are taken to the nearest of the family, as bitr assemble\n"
      "does with the network's, before they are compared.\n"
      "Exit status: 0 done, whichever pose was kept; 2 bad input or usage.\n\n"
      "Examples:\n"
      "  bitr refine part.ply whole.ply --pose result.json --protocol default -o joined.ply\n"
      "  bitr refine part.ply whole.ply --pose identity --method ot --json -");
  return {app, [options] { return run(*options); }};
}

}  // namespace bitr::tool
