// bitr assemble: one pair of clouds, its pose.
#include <bitr/assemble.hpp>
#include <bitr/io.hpp>
#include <bitr/picture.hpp>
#include <chrono>
#include <filesystem>
#include <memory>

#include "assembly_report.hpp"
#include "command.hpp"
#include "device_choice.hpp"
#include "joined_cloud.hpp"
#include "options.hpp"
#include "output.hpp"
#include "pose_file.hpp"

namespace bitr::tool {
namespace {

struct Options {
  std::string source, reference, output, image, json, model, truth;
  bool complete_match = false, strict = false, verify = false;
  std::optional<std::uint64_t> points;
  std::uint64_t seed = 0, model_seed = 0;
  RunOptions run;
};

class Stopwatch {
 public:
  double milliseconds() const {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

struct Input {
  PointCloud cloud;  ///< as read; a mesh is sampled
  PointCloud used;   ///< what the network sees
};

Result<Input> read_input(const std::string& path, const Options& options) {
  io::ReadOptions read;
  read.seed = options.seed;
  if (options.points) read.mesh_points = *options.points;
  auto cloud = io::read_cloud(path, read);
  if (!cloud) return tl::unexpected(cloud.error());
  return Input{std::move(*cloud), {}};
}

Result<Model> choose_model(Options& options, const Input& source, const Input& reference) {
  if (!options.model.empty()) return find_model(options.model);
  if (!options.complete_match) {
    auto model = shipped_model(shipped_models().front().name);
    const bool normals = !source.cloud.normals.empty() && !reference.cloud.normals.empty();
    if (!model || normals || !model->config().return_normals) return model;
    warn("the default model reads normals, and " +
         (source.cloud.normals.empty() ? options.source : options.reference) +
         " has none: falling back to complete matching with untrained weights, which is exact when the "
         "reference is a moved copy of the source and has no answer otherwise");
  }
  options.complete_match = true;
  return untrained_model({}, options.model_seed);
}

// As many points as asked for, or as the model knows.
void choose_points(Input& input, const Options& options, const Model& model, const std::string& path) {
  const std::optional<PointRange> known = model.trained_points();
  std::size_t most = options.points.value_or(known ? (known->low + known->high) / 2 : input.cloud.size());
  if (known && !options.points && input.cloud.size() <= known->high) most = input.cloud.size();
  input.used = io::subsample(input.cloud, most, options.seed);
  if (known && input.used.size() < known->low)
    warn(path + " has " + std::to_string(input.used.size()) + " points; model " + model.name() +
         " was trained on clouds of " + std::to_string(known->low) + " to " + std::to_string(known->high));
}

Result<void> check_outputs(const Options& options) {
  const std::vector<std::string> inputs = {options.source, options.reference, options.model, options.truth};
  if (auto checked = check_output("--output", options.output, inputs); !checked) return checked;
  if (auto checked = check_output("--image", options.image, inputs); !checked) return checked;
  if (auto checked = check_output("--json", options.json, inputs); !checked) return checked;
  if (auto checked = check_profile(options.run, inputs, {options.output, options.image, options.json});
      !checked)
    return checked;
  if (!options.output.empty() && options.output == options.json)
    return fail(ErrorCode::invalid_argument, "--json " + options.json + ": is the file of --output too");
  if (options.image == "-") return fail(ErrorCode::invalid_argument, "--image -: a picture needs a file");
  for (const auto& [option, path] : {std::pair("--output", options.output), {"--json", options.json}})
    if (!path.empty() && options.image == path)
      return fail(ErrorCode::invalid_argument, "--image " + path + ": is the file of " + option + " too");
  if (options.output == "-") return fail(ErrorCode::invalid_argument, "--output -: a cloud needs a file");
  return {};
}

Result<void> write_outputs(const Options& options, const Input& source, const Input& reference,
                           const AssemblyReport& report) {
  Result<void> written;
  std::vector<std::string> made;  // taken back when a later one fails
  const auto write = [&](const std::string& path, const auto& how) {
    if (!written || path.empty()) return;
    written = how(path);
    if (written) made.push_back(path);
  };
  const Assembly& assembly = report.assembly;
  write(options.output, [&](const std::string& path) {
    return io::write_ply(path, joined_cloud(source.cloud, reference.cloud, assembly.T_reference_source));
  });
  write(options.image, [&](const std::string& path) {
    return write_picture(path, source.cloud, reference.cloud, assembly);
  });
  write(options.json, [&](const std::string& path) { return write_json(path, to_json(report)); });
  std::error_code ignored;
  for (const std::string& path : made)
    if (!written && std::filesystem::is_regular_file(path, ignored)) std::filesystem::remove(path, ignored);
  return written;
}

int run(Options& options) {
  if (const auto checked = check_outputs(options); !checked) return complain(checked.error());
  std::optional<Pose> truth;
  if (!options.truth.empty()) {
    const auto read = read_pose(options.truth);
    if (!read) return complain(read.error());
    truth = *read;
  }

  show_progress("reading");
  const Stopwatch total;
  auto source = read_input(options.source, options);
  if (!source) return complain(source.error());
  auto reference = read_input(options.reference, options);
  if (!reference) return complain(reference.error());
  const auto model = choose_model(options, *source, *reference);
  if (!model) return complain(model.error());
  choose_points(*source, options, *model, options.source);
  choose_points(*reference, options, *model, options.reference);

  show_progress("assembling");
  const std::string which = "source " + options.source + ", reference " + options.reference + ": ";
  const CloudPair pair = {source->used, reference->used};
  const AssembleOptions how = {
      .complete_match = options.complete_match, .diagnostics = true, .swap_residual = true};
  const auto device = open_device(options.run);
  if (!device) return complain(device.error());
  auto plan = make_plan(**device, *model, shape_of({&pair, 1}), options.run.plan);
  if (!plan) return complain(plan.error(), which);
  auto assemblies = assemble(*plan, {&pair, 1}, how);
  if (!assemblies) return complain(assemblies.error(), which);
  device->save_cache();

  AssemblyReport report{.assembly = std::move(assemblies->front()),
                        .plan = *plan,
                        .complete_match = options.complete_match,
                        .source_points = source->used.size(),
                        .reference_points = reference->used.size(),
                        .timings = plan->timings(),
                        .total_milliseconds = total.milliseconds(),
                        .truth = truth};
  if (options.verify) {
    show_progress("verifying");
    auto differences = verify(*plan, pair);
    if (!differences) return complain(differences.error(), which);
    report.verification = std::move(*differences);
  }
  clear_progress();

  // With JSON on standard output, text for people goes to standard error.
  print(report, options.json == "-" ? stderr : stdout);
  const Assembly& assembly = report.assembly;
  if (assembly.status == Status::failed)
    return complain(run_failed, which + "a number is not finite; nothing was written");
  if (!within_bounds(report))
    return complain(run_failed,
                    which + "the verification found a stage beyond its bound; nothing was written");
  if (assembly.status == Status::degenerate) {
    const std::string what = which + "the pose is not determined: " + assembly.diagnostics.reason;
    if (options.strict) return complain(run_failed, what + "; nothing was written");
    warn(what);
  }
  if (options.complete_match && assembly.diagnostics.overlap.value_or(1) < 0.9)
    warn(which +
         "the pose leaves much of the source off the reference, so this is no moved copy and complete "
         "matching has no answer for it");
  auto written = write_outputs(options, *source, *reference, report);
  if (written) written = write_profile(options.run, *plan);
  return written ? done : complain(written.error());
}

}  // namespace

Command add_assemble(CLI::App& root) {
  auto options = std::make_shared<Options>();
  CLI::App* app = root.add_subcommand("assemble", "Find the pose that assembles a source with a reference");
  app->add_option("SOURCE", options->source, "Cloud or mesh to be moved")->required()->type_name("FILE");
  app->add_option("REFERENCE", options->reference, "Cloud or mesh that stays")->required()->type_name("FILE");
  app->add_option("-o,--output", options->output, "Write both clouds, assembled, to this PLY file")
      ->type_name("FILE");
  app->add_option("--image", options->image, "Draw both clouds, before and after, to this PNG file")
      ->type_name("FILE");
  add_json(*app, options->json);
  auto* model = add_model(*app, options->model, "unless given, the first of them");
  app->add_flag("--complete-match", options->complete_match,
                "For a reference that is a moved copy of the source; needs no trained model");
  add_seed(*app, "--model-seed", options->model_seed, "Seed of the untrained weights, without --model")
      ->excludes(model);
  add_count(*app, "--points", options->points, 1, most_points,
            "Points to sample from a mesh (2048 unless given), and the most to use of a cloud; unless given, "
            "as many as the model was trained on");
  add_seed(*app, "--seed", options->seed, "Seed of that sampling");
  add_mode(*app, options->run.plan.mode,
           "Norms without their eps (scale-exact) or with it (reference); the model's own unless given");
  add_run_options(*app, options->run);
  app->add_option("--truth", options->truth, "Compare with the true pose in this JSON file")
      ->type_name("FILE");
  app->add_flag("--verify", options->verify,
                "Also evaluate the pair as defined in double precision and compare every stage");
  app->add_flag("--strict", options->strict, "Fail, and write nothing, when the pose is not determined");
  app->footer(
      "Clouds: PLY, PCD, XYZ, TXT, CSV, NPY. Meshes, which are sampled: OBJ, OFF, STL, PLY with faces.\n"
      "The pose is T_reference_source, in the clouds' units: x_reference = R x_source + t.\n"
      "Exit status: 0 done; 1 ran, but the result is not to be used; 2 bad input or usage.\n\n"
      "Examples:\n"
      "  bitr assemble piece.ply other_piece.ply -o assembled.ply --json result.json\n"
      "  bitr assemble nose.ply tail.ply --model aircraft -o assembled.ply\n"
      "  bitr assemble scan.ply moved.ply --complete-match --json -");
  return {app, [options] { return run(*options); }};
}

}  // namespace bitr::tool
