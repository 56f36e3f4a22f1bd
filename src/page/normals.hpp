// The directions that light needs, where a cloud does not have them.
#pragma once

#include <bitr/cloud.hpp>
#include <vector>

#include "core/point_tree.hpp"

namespace bitr::view {

/// Of a plane through each point's neighbours, either side: unit vectors, one per point. The tree is over the
/// points.
std::vector<Vec3f> fitted_normals(const PointTree& tree, const std::vector<Vec3d>& points);

}  // namespace bitr::view
