// The box around some points.
#pragma once

#include <Eigen/Geometry>
#include <bitr/cloud.hpp>
#include <limits>
#include <vector>

namespace bitr::picture {

struct Box {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity()), high = -low;

  void add(const Eigen::Vector3d& point) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  Eigen::Vector3d centre() const { return low / 2 + high / 2; }
  Eigen::Vector3d size() const { return high - low; }
  double diagonal() const { return size().stableNorm(); }
};

inline Box box_of(const std::vector<Vec3d>& points) {
  Box box;
  for (const Vec3d& point : points) box.add(Eigen::Vector3d(point.data()));
  return box;
}

}  // namespace bitr::picture
