// The directions that light needs, where a cloud does not have them.
#pragma once

#include <bitr/cloud.hpp>
#include <vector>

#include "core/point_tree.hpp"

namespace bitr::view {

/// Unit normals of planes through each point's neighbours, one per point, on either side. The tree is over
/// the points.
std::vector<Vec3f> fitted_normals(const PointTree& tree, const std::vector<Vec3d>& points);

}  // namespace bitr::view
