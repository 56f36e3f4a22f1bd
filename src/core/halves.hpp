// Points in blocks of neighbours.
#pragma once

#include <algorithm>
#include <bitr/cloud.hpp>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace bitr {

/// Orders indices of points so that every `block` of them in a row are neighbours: halves ranges at the
/// median of their longest axis. `left(blocks)` of a range's blocks go to its left half, whole ones, so that
/// only the last block is not full.
template <class Left>
void order_by_halves(const std::vector<Vec3d>& points, std::uint32_t* begin, std::uint32_t* end,
                     std::size_t block, const Left& left) {
  const std::size_t count = static_cast<std::size_t>(end - begin);
  if (count <= block) return;
  Vec3d low = points[*begin], high = low;
  for (const std::uint32_t* i = begin; i < end; ++i)
    for (int a = 0; a < 3; ++a) {
      low[a] = std::min(low[a], points[*i][a]);
      high[a] = std::max(high[a], points[*i][a]);
    }
  int axis = 0;
  for (int a = 1; a < 3; ++a)
    if (high[a] - low[a] > high[axis] - low[axis]) axis = a;
  std::uint32_t* middle = begin + left((count + block - 1) / block) * block;
  std::nth_element(begin, middle, end, [&](std::uint32_t a, std::uint32_t b) {
    return points[a][axis] < points[b][axis] || (points[a][axis] == points[b][axis] && a < b);
  });
  order_by_halves(points, begin, middle, block, left);
  order_by_halves(points, middle, end, block, left);
}

}  // namespace bitr
