// Where a picture is seen from.
#pragma once

#include <Eigen/Core>
#include <bitr/cloud.hpp>

namespace bitr::picture {

/// Rows: the camera's right, its up, the direction towards the viewer. The cloud's longest principal axis
/// goes across and its shortest towards the viewer, each pointing to where the cloud reaches farther; then
/// the camera goes up and to the side. It turns with the cloud. `points` is not empty and finite.
Eigen::Matrix3d three_quarter_view(const std::vector<Vec3d>& points);

}  // namespace bitr::picture
