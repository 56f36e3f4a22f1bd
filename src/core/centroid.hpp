// The middle of a cloud.
#pragma once

#include <bitr/cloud.hpp>

namespace bitr {

/// There must be at least one point.
inline Vec3d centroid_of(const Vec3View& positions) {
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

}  // namespace bitr
