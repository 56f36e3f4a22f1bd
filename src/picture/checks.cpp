#include "picture/checks.hpp"

#include <algorithm>
#include <cmath>

#include "core/failure.hpp"

namespace bitr::picture {
namespace {

constexpr double most_coordinate = 1e100;  // squares stay finite

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

void check(const Assembly& assembly) {
  const auto finite = [](const auto& numbers) {
    return std::all_of(numbers.begin(), numbers.end(),
                       [](double x) { return std::abs(x) <= most_coordinate; });
  };
  const Pose& pose = assembly.T_reference_source;
  if (!finite(pose.rotation) || !finite(pose.translation)) refuse("the pose is not finite");
  if (!std::all_of(assembly.source_key_points.begin(), assembly.source_key_points.end(), finite) ||
      !std::all_of(assembly.reference_key_points.begin(), assembly.reference_key_points.end(), finite))
    refuse("a key point is not finite");
}

}  // namespace bitr::picture
