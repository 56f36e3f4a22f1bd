// Fewer points that still show the same surface.
#pragma once

#include <bitr/cloud.hpp>
#include <vector>

namespace bitr::view {

/// Indices of `count` of the points, or of all when there are no more: along a curve that fills their box,
/// every so many, so each region keeps its share of them to within a point or so. Same points, same choice.
/// In the order of the points when all are kept, else along the curve. The points are finite.
std::vector<std::size_t> thinned(const std::vector<Vec3d>& points, std::size_t count);

}  // namespace bitr::view
