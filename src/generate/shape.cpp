#include "generate/shape.hpp"

namespace bitr::generate {

void append(PointCloud& cloud, const SurfacePoint& point, std::size_t most) {
  if (cloud.size() >= most) return;
  const auto& [position, normal] = point;
  cloud.positions.push_back({position.x(), position.y(), position.z()});
  cloud.normals.push_back(
      {static_cast<float>(normal.x()), static_cast<float>(normal.y()), static_cast<float>(normal.z())});
}

PointCloud sample(const Shape& shape, std::size_t count, Random& random) {
  PointCloud cloud;
  cloud.positions.reserve(count);
  cloud.normals.reserve(count);
  std::vector<SurfacePoint> points;
  while (cloud.size() < count) {
    points.clear();
    shape.trial(random, points);
    for (const SurfacePoint& point : points) append(cloud, point, count);
  }
  return cloud;
}

}  // namespace bitr::generate
