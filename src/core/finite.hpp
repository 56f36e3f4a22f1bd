// Whether numbers are numbers.
#pragma once

#include <algorithm>
#include <bitr/pose.hpp>
#include <cmath>

namespace bitr {

inline bool is_finite(const Vec3d& v) {
  return std::all_of(v.begin(), v.end(), [](double x) { return std::isfinite(x); });
}
inline bool is_finite(const Pose& pose) {
  return is_finite(pose.translation) &&
         std::all_of(pose.rotation.begin(), pose.rotation.end(), [](double x) { return std::isfinite(x); });
}

}  // namespace bitr
