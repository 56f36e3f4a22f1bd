#include "data_sets/dense_pair.hpp"

#include "data_sets/choose.hpp"
#include "generate/seeds.hpp"

namespace bitr::data {

DensePair::DensePair(const GeneratedPair& pair)
    : source_(points_of(pair.source)),
      reference_(points_of(pair.reference)),
      overlap_(pair.overlap),
      symmetry_(pair.symmetry) {}

std::vector<DensePair::Point> DensePair::points_of(const PointCloud& cloud) {
  std::vector<Point> points(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Vec3d& at = cloud.positions[i];
    for (int axis = 0; axis < 3; ++axis) points[i].position[axis] = static_cast<float>(at[axis]);
    points[i].normal = cloud.normals[i];
  }
  return points;
}

PointCloud DensePair::draw(const std::vector<Point>& points, std::size_t count, Random& random) {
  const std::vector<std::uint32_t> order = choose(points.size(), count, random);
  PointCloud cloud;
  cloud.positions.reserve(count);
  cloud.normals.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto& [position, normal] = points[order[i]];
    cloud.positions.push_back({position[0], position[1], position[2]});
    cloud.normals.push_back(normal);
  }
  return cloud;
}

GeneratedPair DensePair::draw(std::size_t count, bool same_points, std::uint64_t seed) const {
  Random random = generate::random_for(seed, generate::Draw::points);
  GeneratedPair pair;
  pair.source = draw(source_, count, random);
  pair.reference = same_points ? pair.source : draw(reference_, count, random);
  pair.overlap = overlap_;
  pair.symmetry = symmetry_;
  return pair;
}

}  // namespace bitr::data
