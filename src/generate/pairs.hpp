// From shapes and clouds to pairs.
#pragma once

#include <bitr/generate.hpp>
#include <cstdint>
#include <memory>
#include <string_view>

#include "generate/shape.hpp"

namespace bitr::generate {

/// A uniform rotation, and a shift of up to that on every axis.
Pose random_pose(double translation, Random& random);
/// Positions become R x + t, normals R n.
void move(PointCloud& cloud, const Pose& pose);

/// What becomes of two clouds that are where they belong.
struct Separation {
  double noise = 0, clip = noise_clip;
  double translation = 1;
  bool normals = true;
};

/// Adds noise and moves both clouds into random frames. `pair` has its clouds in the object's frame.
void separate(GeneratedPair& pair, const Separation& how, std::uint64_t seed);

/// `count` points for each side: two samples, or the same one twice.
GeneratedPair sample_twice(const Shape& shape, std::size_t count, bool same_points, std::uint64_t seed);

/// Both sides cropped, and separated.
Result<GeneratedPair> sample_and_crop(const Shape& shape, std::size_t count, bool same_points,
                                      const CropOptions& options);

/// Broken along a random break: one fragment each, not yet separated.
GeneratedPair break_in_two(const Shape& shape, std::size_t count, double roughness, std::uint64_t seed);

/// What a kind does without a protocol.
enum class PairOrigin { broken, copied, cropped };

struct ShapeKind {
  std::string_view shape;  ///< its name among generated_shapes()
  std::unique_ptr<Shape> (*make)(Random& random);
  PairOrigin origin;
};
/// `invalid_argument` when there is none of that name.
Result<const ShapeKind*> kind_named(std::string_view name);

/// The shape of a kind and seed.
std::unique_ptr<Shape> make_shape(const ShapeKind& kind, std::uint64_t seed);

Result<void> check_points(std::size_t points);
/// Errors name the option.
Result<void> check(const CropOptions& options);

}  // namespace bitr::generate
