#include "view/thin.hpp"

#include <algorithm>
#include <cstdint>
#include <numeric>

#include "picture/box.hpp"

namespace bitr::view {
namespace {

/// The place on Morton's curve of a cell, 21 bits an axis.
std::uint64_t morton(const Eigen::Vector3d& cell) {
  std::uint64_t code = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const auto at = static_cast<std::uint64_t>(cell[axis]);
    for (int bit = 0; bit < 21; ++bit) code |= (at >> bit & 1) << (3 * bit + axis);
  }
  return code;
}

}  // namespace

std::vector<std::size_t> thinned(const std::vector<Vec3d>& points, std::size_t count) {
  if (count >= points.size()) {
    std::vector<std::size_t> all(points.size());
    std::iota(all.begin(), all.end(), std::size_t{0});
    return all;
  }
  const picture::Box box = picture::box_of(points);
  const double side = box.size().maxCoeff();
  constexpr double cells = (1 << 21) - 1;
  std::vector<std::pair<std::uint64_t, std::size_t>> order;
  order.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i)
    order.emplace_back(side > 0 ? morton((Eigen::Vector3d(points[i].data()) - box.low) / side * cells) : 0,
                       i);
  std::sort(order.begin(), order.end());
  std::vector<std::size_t> kept(count);
  for (std::size_t i = 0; i < count; ++i)
    kept[i] = order[static_cast<std::size_t>((static_cast<double>(i) + 0.5) *
                                             static_cast<double>(order.size()) / static_cast<double>(count))]
                  .second;
  return kept;
}

}  // namespace bitr::view
