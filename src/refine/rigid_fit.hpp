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

/// The motion that takes from(i) to to(i), i < count, with the least Σ weight(i) |from − to|²; none where no
/// weight is above 0.
template <class Weight, class From, class To>
Pose fit(std::size_t count, const Weight& weight, const From& from, const To& to) {
  Eigen::Vector3d from_mean = Eigen::Vector3d::Zero(), to_mean = from_mean;
  double total = 0;
  for (std::size_t i = 0; i < count; ++i) {
    from_mean += weight(i) * from(i);
    to_mean += weight(i) * to(i);
    total += weight(i);
  }
  if (!(total > 0)) return {};
  from_mean /= total;
  to_mean /= total;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < count; ++i)
    covariance += weight(i) * (to(i) - to_mean) * (from(i) - from_mean).transpose();
  const Eigen::Matrix3d R = nearest_rotation(covariance);
  return pose_of(R, to_mean - R * from_mean);
}

/// Σ |entries of a − entries of b| of R and t.
double absolute_change(const Pose& a, const Pose& b);

}  // namespace bitr::refine
