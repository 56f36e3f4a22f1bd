#include "refine/principal_axes.hpp"

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace bitr::refine {
namespace {

struct AxesFrame {
  Eigen::Vector3d centroid;
  Eigen::Matrix3d axes;  ///< in columns, right-handed
};

AxesFrame principal_frame(const std::vector<Vec3d>& points) {
  AxesFrame frame;
  frame.centroid.setZero();
  for (const Vec3d& point : points) frame.centroid += Eigen::Vector3d(point.data());
  frame.centroid /= static_cast<double>(points.size());
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const Vec3d& point : points) {
    const Eigen::Vector3d from_centroid = Eigen::Vector3d(point.data()) - frame.centroid;
    covariance += from_centroid * from_centroid.transpose();
  }
  frame.axes = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance).eigenvectors();
  if (frame.axes.determinant() < 0) frame.axes.col(0) *= -1;
  return frame;
}

}  // namespace

std::array<Pose, 4> align_principal_axes(const std::vector<Vec3d>& source,
                                         const std::vector<Vec3d>& reference) {
  static const Eigen::Vector3d signs[4] = {{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}};
  const AxesFrame from = principal_frame(source), to = principal_frame(reference);
  std::array<Pose, 4> poses;
  for (int i = 0; i < 4; ++i) {
    const Eigen::Matrix3d R = to.axes * signs[i].asDiagonal() * from.axes.transpose();
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(poses[i].rotation.data()) = R;
    Eigen::Map<Eigen::Vector3d>(poses[i].translation.data()) = to.centroid - R * from.centroid;
  }
  return poses;
}

IcpResult icp_from_principal_axes(const std::vector<Vec3d>& source, const std::vector<Vec3d>& reference,
                                  const IcpOptions& options) {
  const Icp icp(reference, options);
  IcpResult best;
  bool first = true;
  for (const Pose& start : align_principal_axes(source, reference)) {
    const IcpResult result = icp.align(source, start);
    if (first || result.rmse < best.rmse) best = result;
    first = false;
  }
  return best;
}

}  // namespace bitr::refine
