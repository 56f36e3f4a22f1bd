// What can be drawn.
#pragma once

#include <bitr/assemble.hpp>
#include <bitr/cloud.hpp>
#include <string>

namespace bitr::picture {

/// Throws a Failure, `invalid_argument`, where the cloud is empty, has normals that are not one per point or
/// a coordinate that is not finite or beyond 1e100.
void check(const PointCloud& cloud, const std::string& name);
/// The same where the pose or a key point is not finite.
void check(const Assembly& assembly);
void check(const Pose& pose);

}  // namespace bitr::picture
