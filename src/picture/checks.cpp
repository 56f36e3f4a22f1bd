#include "picture/checks.hpp"

#include <algorithm>
#include <cmath>

#include "core/failure.hpp"

namespace bitr::picture {
namespace {

constexpr double most_coordinate = 1e100;  // squares stay finite

template <class Numbers>
bool within_bounds(const Numbers& numbers) {
  return std::all_of(numbers.begin(), numbers.end(), [](double x) { return std::abs(x) <= most_coordinate; });
}

}  // namespace

void check(const PointCloud& cloud, const std::string& name) {
  if (cloud.positions.empty()) refuse(name + ": no points to draw");
  if (!cloud.normals.empty() && cloud.normals.size() != cloud.size())
    refuse(name + ": " + std::to_string(cloud.normals.size()) + " normals for " +
           std::to_string(cloud.size()) + " points");
  for (std::size_t i = 0; i < cloud.size(); ++i)
    for (const double x : cloud.positions[i])
      if (!(std::abs(x) <= most_coordinate))
        refuse(name + ": point " + std::to_string(i) +
               " has a coordinate that is not finite or beyond 1e100");
}

void check(const Pose& pose) {
  if (!within_bounds(pose.rotation) || !within_bounds(pose.translation)) refuse("the pose is not finite");
}

void check(const Assembly& assembly) {
  check(assembly.T_reference_source);
  for (const auto* points : {&assembly.source_key_points, &assembly.reference_key_points})
    if (!std::all_of(points->begin(), points->end(), [](const Vec3d& point) { return within_bounds(point); }))
      refuse("a key point is not finite");
}

}  // namespace bitr::picture
