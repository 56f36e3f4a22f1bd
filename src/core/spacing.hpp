// How densely a cloud samples its surface.
#pragma once

#include "core/point_tree.hpp"

namespace bitr {

/// Median distance from a point to its nearest other place, over an even sample of 2,000 points at least.
/// Duplicates of a point are at its own place; 0 when every sampled point has nothing but duplicates near.
double median_spacing(const PointTree& tree, const std::vector<Vec3d>& points);

}  // namespace bitr
