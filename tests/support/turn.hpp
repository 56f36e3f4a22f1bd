// A known rotation.
#pragma once

#include <Eigen/Core>
#include <bitr/pose.hpp>
#include <cmath>
#include <numbers>

namespace bitr::test {

/// About a unit axis through the origin, by the right-hand rule.
inline Pose turn_about(const Eigen::Vector3d& axis, double degrees) {
  const double angle = degrees * std::numbers::pi / 180;
  const double c = std::cos(angle), s = std::sin(angle), d = 1 - c;
  const double x = axis[0], y = axis[1], z = axis[2];
  return {{c + x * x * d, x * y * d - z * s, x * z * d + y * s, y * x * d + z * s, c + y * y * d,
           y * z * d - x * s, z * x * d - y * s, z * y * d + x * s, c + z * z * d},
          {}};
}

}  // namespace bitr::test
