// Points along a curve that fills their box (Morton's): what is near in space comes to be near in memory.
#pragma once

#include <algorithm>
#include <array>
#include <bitr/pose.hpp>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace bitr {

/// Bits 0, 3, 6 … of the result are the lowest 21 bits of `x`.
inline std::uint64_t every_third_bit(std::uint64_t x) {
  x = (x | x << 32) & 0x001f00000000ffff;
  x = (x | x << 16) & 0x001f0000ff0000ff;
  x = (x | x << 8) & 0x100f00f00f00f00f;
  x = (x | x << 4) & 0x10c30c30c30c30c3;
  return (x | x << 2) & 0x1249249249249249;
}

/// Indices of `count` finite points, point(i) → Vec3d, along the curve through their box. The same points
/// come in the same order whatever theirs was, but for those that are equal.
template <class Point>
std::vector<std::uint32_t> morton_order(std::size_t count, Point point) {
  Vec3d low, high;
  low.fill(std::numeric_limits<double>::infinity());
  high.fill(-std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3d p = point(i);
    for (int a = 0; a < 3; ++a) {
      low[a] = std::min(low[a], p[a]);
      high[a] = std::max(high[a], p[a]);
    }
  }
  const double side = std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
  constexpr double cells = (1 << 21) - 1;
  struct Place {
    std::uint64_t code;
    std::uint32_t index;
  };
  std::vector<Place> places(count);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3d p = point(i);
    std::uint64_t code = 0;
    if (side > 0)
      for (int a = 0; a < 3; ++a)
        code |= every_third_bit(static_cast<std::uint64_t>((p[a] - low[a]) / side * cells)) << a;
    places[i] = {code, static_cast<std::uint32_t>(i)};
  }
  std::sort(places.begin(), places.end(), [&](const Place& a, const Place& b) {
    if (a.code != b.code) return a.code < b.code;
    const Vec3d p = point(a.index), q = point(b.index);
    return p != q ? p < q : a.index < b.index;
  });
  std::vector<std::uint32_t> order(count);
  std::transform(places.begin(), places.end(), order.begin(), [](const Place& place) { return place.index; });
  return order;
}

}  // namespace bitr
