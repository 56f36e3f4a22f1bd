// Random rotations and poses for property tests.
#pragma once

#include <Eigen/Core>
#include <bitr/pose.hpp>

#include "core/random.hpp"

namespace bitr::test {

inline Eigen::Matrix3d random_rotation(Random& random) {
  const auto r = random.rotation();
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(r.data());
}

inline Eigen::Vector3d random_unit(Random& random) { return random_rotation(random).col(0); }

inline Pose random_pose(Random& random, double shift = 1) {
  return {random.rotation(),
          {shift * random.uniform(-1, 1), shift * random.uniform(-1, 1), shift * random.uniform(-1, 1)}};
}

}  // namespace bitr::test
