#include "refine/rigid_fit.hpp"

#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>

namespace bitr::refine {

Pose pose_of(const Eigen::Matrix3d& R, const Eigen::Vector3d& t) {
  Pose pose;
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(pose.rotation.data()) = R;
  Eigen::Map<Eigen::Vector3d>(pose.translation.data()) = t;
  return pose;
}

Eigen::Matrix3d rotation_of(const Pose& pose) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(pose.rotation.data());
}

Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& covariance) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d u = svd.matrixU();
  if ((u * svd.matrixV().transpose()).determinant() < 0) u.col(2) *= -1;
  return u * svd.matrixV().transpose();
}

double absolute_change(const Pose& a, const Pose& b) {
  double sum = 0;
  for (std::size_t i = 0; i < 9; ++i) sum += std::abs(a.rotation[i] - b.rotation[i]);
  for (std::size_t i = 0; i < 3; ++i) sum += std::abs(a.translation[i] - b.translation[i]);
  return sum;
}

}  // namespace bitr::refine
