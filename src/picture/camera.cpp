#include "picture/camera.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <numbers>

#include "picture/box.hpp"

namespace bitr::picture {

Eigen::Matrix3d three_quarter_view(const std::vector<Vec3d>& points) {
  // In units of the cloud's size: no square or cube overflows.
  const Box box = box_of(points);
  const double size = box.diagonal() > 0 ? box.diagonal() : 1;
  const auto normalised = [&](const Vec3d& point) -> Eigen::Vector3d {
    return (Eigen::Vector3d(point.data()) - box.centre()) / size;
  };
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
  for (const Vec3d& point : points) centroid += normalised(point);
  centroid /= static_cast<double>(points.size());
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const Vec3d& point : points) {
    const Eigen::Vector3d x = normalised(point) - centroid;
    covariance += x * x.transpose();
  }
  const Eigen::Matrix3d axes = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance).eigenvectors();
  Eigen::Vector3d right = axes.col(2), towards = axes.col(0);

  // A solver's signs are arbitrary; the third moments are the cloud's own.
  double right_skew = 0, towards_skew = 0;
  for (const Vec3d& point : points) {
    const Eigen::Vector3d x = normalised(point) - centroid;
    const double across = x.dot(right), near = x.dot(towards);
    right_skew += across * across * across;
    towards_skew += near * near * near;
  }
  if (right_skew < 0) right = -right;
  if (towards_skew < 0) towards = -towards;

  Eigen::Matrix3d flat;
  flat << right.transpose(), towards.cross(right).transpose(), towards.transpose();
  constexpr double degree = std::numbers::pi / 180;
  return Eigen::AngleAxisd(-32 * degree, Eigen::Vector3d::UnitX()).toRotationMatrix() *
         Eigen::AngleAxisd(25 * degree, Eigen::Vector3d::UnitY()).toRotationMatrix() * flat;
}

}  // namespace bitr::picture
