// The rigid motion that fits corresponding points best.
#pragma once

#include <Eigen/Core>
#include <bitr/pose.hpp>

namespace bitr::refine {

inline Eigen::Vector3d vector(const Vec3d& point) { return Eigen::Vector3d(point.data()); }

Pose pose_of(const Eigen::Matrix3d& R, const Eigen::Vector3d& t);
Eigen::Matrix3d rotation_of(const Pose& pose);

/// The rotation nearest to a covariance Σ w (to − t̄o)(from − f̄rom)ᵀ (Kabsch, by its singular values).
Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& covariance);

/// Σ |entries of a − entries of b| of R and t.
double absolute_change(const Pose& a, const Pose& b);

}  // namespace bitr::refine
