// Solids as implicit functions, and points on their surfaces.
#pragma once

#include <Eigen/Core>
#include <bitr/cloud.hpp>
#include <cstddef>
#include <functional>

#include "core/random.hpp"

namespace bitr::generate {

/// Negative inside a solid. |field(x)| never exceeds the distance from x to the solid's surface.
using Field = std::function<double(const Eigen::Vector3d&)>;

/// `count` points, uniform by area over the zero level inside the ball of `radius` around the origin, with
/// outward unit normals. Positions are within 1e-12·radius of the level along the line that found them.
///
/// Lines drawn uniformly over those that meet the ball cross every piece of surface equally often per area
/// (Cauchy–Crofton), so each crossing is a sample and no mesh or rejection is needed.
PointCloud sample_surface(const Field& field, double radius, std::size_t count, Random& random);

}  // namespace bitr::generate
