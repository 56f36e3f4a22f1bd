#include "page/thin.hpp"

#include <numeric>

#include "core/morton.hpp"

namespace bitr::view {

std::vector<std::size_t> thinned(const std::vector<Vec3d>& points, std::size_t count) {
  if (count >= points.size()) {
    std::vector<std::size_t> all(points.size());
    std::iota(all.begin(), all.end(), std::size_t{0});
    return all;
  }
  const auto order = morton_order(points.size(), [&](std::size_t i) { return points[i]; });
  std::vector<std::size_t> kept(count);
  for (std::size_t i = 0; i < count; ++i)
    kept[i] = order[static_cast<std::size_t>((static_cast<double>(i) + 0.5) *
                                             static_cast<double>(order.size()) / static_cast<double>(count))];
  return kept;
}

}  // namespace bitr::view
