#include "refine/surface.hpp"

#include "core/centroid.hpp"
#include "core/failure.hpp"
#include "core/finite.hpp"
#include "core/spacing.hpp"

namespace bitr::refine {
namespace {

constexpr std::size_t fewest_points = 3;

std::vector<Vec3d> centred(const Vec3View& positions, const Vec3d& centroid) {
  std::vector<Vec3d> points = points_of(positions);
  for (Vec3d& point : points)
    for (int a = 0; a < 3; ++a) point[a] -= centroid[a];
  return points;
}

void require_surface(const CloudView& cloud, const std::string& which) {
  const auto refuse = [&](const std::string& why) {
    throw Failure(ErrorCode::invalid_argument, which + ": " + why);
  };
  const Vec3View &positions = cloud.positions, &normals = cloud.normals;
  if (positions.count < fewest_points)
    refuse(std::to_string(positions.count) + " points; at least " + std::to_string(fewest_points) +
           " are needed");
  if (!normals.empty() && normals.count != positions.count)
    refuse(std::to_string(normals.count) + " normals for " + std::to_string(positions.count) + " points");
  for (std::size_t i = 0; i < positions.count; ++i)
    if (!is_finite(positions[i])) refuse("point " + std::to_string(i) + " is not finite");
  for (std::size_t i = 0; i < normals.count; ++i)
    if (!is_finite(normals[i])) refuse("normal " + std::to_string(i) + " is not finite");
}

}  // namespace

Surface::Surface(const CloudView& cloud)
    : centroid(centroid_of(cloud.positions)),
      points(centred(cloud.positions, centroid)),
      normals(points_of(cloud.normals)),
      tree(3, rows, {10}),
      spacing(median_spacing(tree, points)),
      tree_bytes(tree.usedMemory(tree)) {
  const std::size_t asked = std::min(points.size(), most_asked);
  some.resize(asked);
  for (std::size_t i = 0; i < asked; ++i) some[i] = static_cast<std::uint32_t>(i * points.size() / asked);
}

std::size_t Surface::bytes() const {
  return (points.size() + normals.size()) * sizeof(Vec3d) + some.size() * sizeof(some[0]) + tree_bytes;
}

std::string pair_name(std::size_t pair, std::size_t pairs) {
  return pairs > 1 ? "pair " + std::to_string(pair) + ": " : "";
}

void require_surfaces(std::span<const CloudPair> pairs) {
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const std::string which = pair_name(i, pairs.size());
    require_surface(pairs[i].source, which + "source");
    require_surface(pairs[i].reference, which + "reference");
  }
}

void keep_common_normals(Surface& source, Surface& reference) {
  if (source.has_normals() && reference.has_normals()) return;
  source.normals.clear();
  reference.normals.clear();
}

Pose centred(const Pose& T_reference_source, const Surface& source, const Surface& reference) {
  // t' = R c_source + t − c_reference, without the detour over two products.
  Pose result = T_reference_source;
  result.translation = T_reference_source.apply(source.centroid);
  for (int a = 0; a < 3; ++a) result.translation[a] -= reference.centroid[a];
  return result;
}

}  // namespace bitr::refine
