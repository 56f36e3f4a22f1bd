#include "refine/icp.hpp"

#include <Eigen/Core>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "core/point_tree.hpp"

namespace bitr::refine {
namespace {

struct Match {
  double squared;
  std::uint32_t source, reference;
  bool operator<(const Match& other) const {
    return squared < other.squared || (squared == other.squared && source < other.source);
  }
};

Eigen::Vector3d vector(const Vec3d& point) { return Eigen::Vector3d(point.data()); }

/// The rigid motion with the least squares (Kabsch).
Pose fit(const std::vector<Vec3d>& source, const std::vector<Vec3d>& reference,
         const std::vector<Match>& matches, std::size_t count) {
  Eigen::Vector3d from = Eigen::Vector3d::Zero(), to = from;
  for (std::size_t i = 0; i < count; ++i) {
    from += vector(source[matches[i].source]);
    to += vector(reference[matches[i].reference]);
  }
  from /= static_cast<double>(count);
  to /= static_cast<double>(count);
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < count; ++i)
    covariance += (vector(reference[matches[i].reference]) - to) *
                  (vector(source[matches[i].source]) - from).transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d u = svd.matrixU();
  if ((u * svd.matrixV().transpose()).determinant() < 0) u.col(2) *= -1;
  const Eigen::Matrix3d R = u * svd.matrixV().transpose();
  Pose pose;
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(pose.rotation.data()) = R;
  Eigen::Map<Eigen::Vector3d>(pose.translation.data()) = to - R * from;
  return pose;
}

double change(const Pose& a, const Pose& b) {
  double sum = 0;
  for (std::size_t i = 0; i < 9; ++i) sum += std::abs(a.rotation[i] - b.rotation[i]);
  for (std::size_t i = 0; i < 3; ++i) sum += std::abs(a.translation[i] - b.translation[i]);
  return sum;
}

}  // namespace

struct Icp::Index {
  std::vector<Vec3d> points;
  PointRows rows{points};
  PointTree tree{3, rows, {10}};
  explicit Index(const std::vector<Vec3d>& reference) : points(reference) {}
};

Icp::Icp(const std::vector<Vec3d>& reference, const IcpOptions& options)
    : index_(std::make_unique<const Index>(reference)), options_(options) {}
Icp::~Icp() = default;

IcpResult Icp::align(const std::vector<Vec3d>& source, const Pose& start) const {
  const std::size_t fewer = std::min(source.size(), index_->points.size());
  const std::size_t kept =
      std::clamp<std::size_t>(static_cast<std::size_t>(options_.keep * static_cast<double>(fewer)),
                              std::min<std::size_t>(3, fewer), fewer);
  std::vector<Match> matches(source.size());
  IcpResult result;
  result.T_reference_source = start;
  while (result.iterations < options_.most_iterations) {
    ++result.iterations;
    for (std::uint32_t i = 0; i < source.size(); ++i) {
      const Vec3d moved = result.T_reference_source.apply(source[i]);
      matches[i].source = i;
      index_->tree.knnSearch(moved.data(), 1, &matches[i].reference, &matches[i].squared);
    }
    std::nth_element(matches.begin(), matches.begin() + (kept - 1), matches.end());
    double squares = 0;
    for (std::size_t i = 0; i < kept; ++i) squares += matches[i].squared;
    result.rmse = std::sqrt(squares / static_cast<double>(kept));
    const Pose next = fit(source, index_->points, matches, kept);
    const double moved = change(next, result.T_reference_source);
    result.T_reference_source = next;
    if (moved < options_.tolerance) break;
  }
  return result;
}

}  // namespace bitr::refine
