#include "refine/surface.hpp"

#include "refine/spacing.hpp"

namespace bitr::refine {
namespace {

Vec3d mean(const Vec3View& positions) {
  // About the first point, so that large coordinates keep their digits.
  const Vec3d first = positions[0];
  Vec3d sum{};
  for (std::size_t i = 0; i < positions.count; ++i) {
    const Vec3d point = positions[i];
    for (int a = 0; a < 3; ++a) sum[a] += point[a] - first[a];
  }
  for (int a = 0; a < 3; ++a) sum[a] = first[a] + sum[a] / static_cast<double>(positions.count);
  return sum;
}

std::vector<Vec3d> centred(const Vec3View& positions, const Vec3d& centroid) {
  std::vector<Vec3d> points = points_of(positions);
  for (Vec3d& point : points)
    for (int a = 0; a < 3; ++a) point[a] -= centroid[a];
  return points;
}

}  // namespace

Surface::Surface(const CloudView& cloud)
    : centroid(mean(cloud.positions)),
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

}  // namespace bitr::refine
