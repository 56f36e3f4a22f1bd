// Procedural pairs of clouds with a known answer, for examples, tests, benchmarks and training.
#pragma once

#include <bitr/cloud.hpp>
#include <bitr/pose.hpp>
#include <bitr/result.hpp>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace bitr {

/// Lengths are in model units: every generated object fits in a ball of radius 0.5.
struct GenerateOptions {
  std::size_t points = 2048;  ///< of each cloud, 1 … max_generated_points
  double noise = 0;           ///< standard deviation added to every coordinate, 0 … 1
  double roughness = 0.02;    ///< standard deviation of a break's relief, 0 … 0.1
  std::uint64_t seed = 0;     ///< same seed, same shape and poses; same options, same points
};

inline constexpr std::size_t max_generated_points = 10'000'000;

/// Two clouds with outward unit normals, each in a random frame of its own, and the motion that joins them.
struct GeneratedPair {
  PointCloud source;
  PointCloud reference;
  Pose T_reference_source;
};

struct GeneratedKind {
  std::string_view name;
  std::string_view summary;  ///< one line
};

/// What generate_pair can make.
std::span<const GeneratedKind> generated_kinds();

/// `invalid_argument` when the kind is unknown or an option is out of its range.
Result<GeneratedPair> generate_pair(std::string_view kind, const GenerateOptions& options = {});

}  // namespace bitr
