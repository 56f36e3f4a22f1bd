// Clouds and models as a command takes them: from files, with as many points as the model knows.
#pragma once

#include <bitr/cloud.hpp>
#include <bitr/model.hpp>
#include <cstdint>
#include <optional>
#include <string>

#include "cli.hpp"

namespace bitr::tool {

struct CloudOptions {
  std::optional<std::uint64_t> points;
  std::uint64_t seed = 0;
  bool strict = false;  ///< holes are refused
};
/// --points, --seed
void add_cloud_options(CLI::App& app, CloudOptions& options);

struct CloudInput {
  std::string path;
  PointCloud cloud;                     ///< as read; a mesh is sampled
  std::size_t holes = 0, bare = 0;      ///< see io::Scan
  std::optional<Vec3d> viewpoint = {};  ///< the file's, or what was said
  PointCloud used;                      ///< what is looked at, if it was chosen; else all of it
};

/// `used` is empty yet. Errors as of io::read_cloud.
Result<CloudInput> read_input(const std::string& path, const CloudOptions& options);

/// For commands whose report does not count them.
void warn_of_holes(const CloudInput& input);
/// `bad_file` when some points have no normal, and the model reads normals.
Result<void> check_normals(const CloudInput& input, const Model& model);
/// Fills `used`: as many points as asked for, or as the model was trained on.
void choose_points(CloudInput& input, const CloudOptions& options, const Model& model);
/// Only where fewer are asked for than there are.
void choose_points(CloudInput& input, const CloudOptions& options);
/// Whether the model was trained on larger clouds.
bool too_few_points(const CloudInput& input, const Model& model);

/// Points that are looked at.
std::size_t looked_at(const CloudInput& input);

/// "scan.ply (2048 of 1000000 points)".
std::string described(const CloudInput& input);

struct ModelChoice {
  std::string model;
  bool complete_match = false;
  std::uint64_t seed = 0;  ///< seed of untrained weights
};
/// Whether one network is to be asked, and nobody else.
bool names_network(const ModelChoice& choice);
/// --model, --complete-match, --model-seed, and --mode into `mode`.
void add_model_options(CLI::App& app, ModelChoice& options, std::optional<Mode>& mode);
/// The one named, or with complete matching untrained weights. Errors as of find_model.
Result<Model> choose_model(const ModelChoice& options);

}  // namespace bitr::tool
