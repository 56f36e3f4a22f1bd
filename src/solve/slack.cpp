#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "refine/rigid_fit.hpp"
#include "solve/judge.hpp"

namespace bitr::solving {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr double reach = 1.5;  // resolutions
constexpr double slide = 4;    // resolutions: how far points move that could slide
constexpr int directions = 2;  // the least determined ones

}  // namespace

double slack(const Level& source, const Level& reference, const Pose& T, double score) {
  const double v = source.resolution;
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> touching;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Vec3d& point : source.points) {
    const Vec3d moved = T.apply(point);
    const NearestWithin nearest = nearest_within(reference, moved, reach * v);
    if (!nearest.found()) continue;
    touching.emplace_back(vector(moved), vector(reference.normals[nearest.index()]));
    middle += vector(moved);
  }
  if (touching.size() < 6 || !(score > 0)) return 1;
  const auto count = static_cast<double>(touching.size());
  middle /= count;
  double squares = 0;
  for (const auto& [p, n] : touching) squares += (p - middle).squaredNorm();
  const double radius = std::max(std::sqrt(squares / count), v);
  Matrix6 A = Matrix6::Zero();
  for (const auto& [p, n] : touching) {
    Vector6 moves;
    moves << (p - middle).cross(n) / radius, n;
    A += moves * moves.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Matrix6> modes(A);
  double most = 0;
  for (int k = 0; k < directions; ++k)
    for (const double sign : {-1.0, 1.0}) {
      const Vector6 mode = sign * modes.eigenvectors().col(k);
      const double angle = mode.head<3>().norm() * slide * v / radius;
      Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
      if (angle > 0) R = Eigen::AngleAxisd(angle, mode.head<3>().normalized()).toRotationMatrix();
      const Pose step = refine::pose_of(R, middle + slide * v * mode.tail<3>() - R * middle);
      most = std::max(most, fit(source, reference, step * T, 2).score);
    }
  return std::min(1.0, most / score);
}

}  // namespace bitr::solving
