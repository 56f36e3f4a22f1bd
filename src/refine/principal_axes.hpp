// Registration without learning: the clouds' centroids and principal axes, tried in every way, then ICP.
#pragma once

#include <array>

#include "refine/icp.hpp"

namespace bitr::refine {

/// The four proper rotations that take the source's principal axes to the reference's, in the order of their
/// variances, with the translation that joins the centroids. Clouds have at least one point.
std::array<Pose, 4> align_principal_axes(const std::vector<Vec3d>& source,
                                         const std::vector<Vec3d>& reference);

/// ICP from each of the four; the one that ends with the least rmse.
IcpResult icp_from_principal_axes(const std::vector<Vec3d>& source, const std::vector<Vec3d>& reference,
                                  const IcpOptions& options = {});

}  // namespace bitr::refine
