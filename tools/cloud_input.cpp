#include "cloud_input.hpp"

#include <CLI/CLI.hpp>
#include <bitr/io.hpp>

#include "options.hpp"

namespace bitr::tool {

void add_cloud_options(CLI::App& app, CloudOptions& options) {
  add_count(
      app, "--points", options.points, 1, most_points,
      "Points to sample from a mesh (2048 unless given), and the most to use of a cloud; unless given, all "
      "of them, or with --model as many as it was trained on");
  add_seed(app, "--seed", options.seed, "Seed of that sampling");
}

Result<CloudInput> read_input(const std::string& path, const CloudOptions& options) {
  io::ReadOptions read;
  read.seed = options.seed;
  if (options.points) read.mesh_points = *options.points;
  read.strict = options.strict;
  auto scan = io::read_scan(path, read);
  if (!scan) return tl::unexpected(scan.error());
  CloudInput input;
  input.path = path;
  input.cloud = std::move(scan->cloud);
  input.holes = scan->holes;
  input.bare = scan->bare;
  input.viewpoint = scan->viewpoint;
  return input;
}

void warn_of_holes(const CloudInput& input) {
  warn(input.path + ": " + std::to_string(input.holes) + (input.holes == 1 ? " point is" : " points are") +
       " not finite and left out");
}

Result<void> check_normals(const CloudInput& input, const Model& model) {
  if (input.bare == 0 || !model.config().return_normals) return {};
  return fail(ErrorCode::bad_file, input.path + ": " + std::to_string(input.bare) + " of " +
                                       std::to_string(input.cloud.size()) +
                                       " points have no normal, which model " + model.name() +
                                       " reads; without --model they are estimated");
}

void choose_points(CloudInput& input, const CloudOptions& options) {
  if (options.points && *options.points < input.cloud.size())
    input.used = io::subsample(input.cloud, *options.points, options.seed);
}

void choose_points(CloudInput& input, const CloudOptions& options, const Model& model) {
  const std::optional<PointRange> known = model.trained_points();
  std::size_t most = options.points.value_or(known ? (known->low + known->high) / 2 : input.cloud.size());
  if (known && !options.points && input.cloud.size() <= known->high) most = input.cloud.size();
  input.used = io::subsample(input.cloud, most, options.seed);
}

bool too_few_points(const CloudInput& input, const Model& model) {
  const std::optional<PointRange> known = model.trained_points();
  return known && input.used.size() < known->low;
}

std::size_t looked_at(const CloudInput& input) {
  return input.used.positions.empty() ? input.cloud.size() : input.used.size();
}

std::string described(const CloudInput& input) {
  const std::size_t used = looked_at(input), all = input.cloud.size();
  return input.path + " (" + (used == all ? "" : std::to_string(used) + " of ") + std::to_string(all) +
         " points)";
}

void add_model_options(CLI::App& app, ModelChoice& options, std::optional<Mode>& mode) {
  auto* model = add_model(app, options.model, "unless given, geometry and all of them");
  app.add_flag("--complete-match", options.complete_match,
               "For a reference that is a moved copy of the source; needs no trained model");
  add_seed(app, "--model-seed", options.seed, "Seed of the untrained weights, without --model")
      ->excludes(model);
  add_mode(app, mode,
           "Norms without their eps (scale-exact) or with it (reference); the model's own unless given");
}

bool names_network(const ModelChoice& choice) { return !choice.model.empty() || choice.complete_match; }

Result<Model> choose_model(const ModelChoice& options) {
  if (!options.model.empty()) return find_model(options.model);
  return untrained_model({}, options.seed);
}

}  // namespace bitr::tool
