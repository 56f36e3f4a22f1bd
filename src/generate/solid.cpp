#include "generate/solid.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>

#include "generate/field.hpp"

namespace bitr::generate {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Matrix3d random_axes(Random& random) {
  const auto rotation = random.rotation();
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rotation.data());
}

// Minimum with a fillet of width `blend`. Its gradient is a mean of the two gradients, so that it bounds the
// distance where they do, and it lies at most blend/4 below the minimum.
double smooth_minimum(double a, double b, double blend) {
  const double overlap = std::max(0.0, 1 - std::abs(a - b) / blend);
  return std::min(a, b) - blend * overlap * overlap / 4;
}

}  // namespace

double Solid::Part::distance(const Vector3d& at) const {
  const Vector3d local = axes * (at - center);
  if (!box) return (local.cwiseQuotient(half_size).norm() - 1) * half_size.minCoeff();
  const double rounding = 0.3 * half_size.minCoeff();
  const Vector3d outside = local.cwiseAbs() - half_size + Vector3d::Constant(rounding);
  return outside.cwiseMax(0).norm() + std::min(0.0, outside.maxCoeff()) - rounding;
}

double Solid::Part::reach() const { return center.norm() + (box ? half_size.norm() : half_size.maxCoeff()); }

Solid::Solid(Random& random) : blend_(0.08) {
  const auto half_size = [&](double low, double high) {
    return Vector3d{{random.uniform(low, high), random.uniform(low, high), random.uniform(low, high)}};
  };
  parts_.push_back({random_axes(random), Vector3d::Zero(), half_size(0.1, 0.2), false});
  const auto lobes = 2 + random.below(3);
  for (std::uint64_t i = 0; i < lobes; ++i) {
    // Centred on the surface so far, a lobe is always attached.
    const PointCloud center = sample_surface(*this, 1, 1, random);
    parts_.push_back({random_axes(random), Vector3d(center.positions[0].data()), half_size(0.05, 0.25),
                      random.uniform() < 0.5});
  }

  Vector3d middle = Vector3d::Zero();
  for (const Part& part : parts_) middle += part.center / static_cast<double>(parts_.size());
  for (Part& part : parts_) part.center -= middle;
  double reach = 0;
  for (const Part& part : parts_) reach = std::max(reach, part.reach());
  const double scale = solid_radius / (reach + blend_ / 4 * static_cast<double>(lobes));
  for (Part& part : parts_) {
    part.center *= scale;
    part.half_size *= scale;
  }
  blend_ *= scale;
}

double Solid::operator()(const Vector3d& at) const {
  double distance = parts_.front().distance(at);
  for (std::size_t i = 1; i < parts_.size(); ++i)
    distance = smooth_minimum(distance, parts_[i].distance(at), blend_);
  return distance;
}

PointCloud interior(const Solid& solid) {
  constexpr int cells = 24;
  const auto coordinate = [](int i) { return solid_radius * ((2 * i + 1.0) / cells - 1); };
  PointCloud cloud;
  for (int i = 0; i < cells; ++i)
    for (int j = 0; j < cells; ++j)
      for (int k = 0; k < cells; ++k) {
        const Vector3d at(coordinate(i), coordinate(j), coordinate(k));
        if (solid(at) < 0) cloud.positions.push_back({at.x(), at.y(), at.z()});
      }
  return cloud;
}

double asymmetry(const PointCloud& cloud) {
  const auto count = static_cast<double>(cloud.size());
  const auto point = [&](std::size_t i) { return Vector3d(cloud.positions[i].data()); };
  Vector3d mean = Vector3d::Zero();
  for (std::size_t i = 0; i < cloud.size(); ++i) mean += point(i) / count;
  Matrix3d covariance = Matrix3d::Zero();
  for (std::size_t i = 0; i < cloud.size(); ++i)
    covariance += (point(i) - mean) * (point(i) - mean).transpose() / count;
  const Eigen::SelfAdjointEigenSolver<Matrix3d> principal(covariance);
  const Vector3d& variance = principal.eigenvalues();
  if (!(variance[0] > 0)) return 0;

  // Distinct variances leave only half-turns about the principal axes, and each of those flips two components
  // of the third moment: a second one that is not zero excludes them all.
  const double distinct = std::min(variance[1] - variance[0], variance[2] - variance[1]) / variance[2];
  Vector3d third = Vector3d::Zero();
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Vector3d local = principal.eigenvectors().transpose() * (point(i) - mean);
    third += local * local.squaredNorm() / count;
  }
  std::array<double, 3> skew;
  for (int axis = 0; axis < 3; ++axis) skew[axis] = std::abs(third[axis]) / std::pow(variance.sum(), 1.5);
  std::sort(skew.begin(), skew.end());
  return std::min(distinct, 5 * skew[1]);
}

Solid random_solid(Random& random) {
  constexpr double clear = 0.1;
  for (int attempt = 0; attempt < 63; ++attempt) {
    Solid solid(random);
    if (asymmetry(interior(solid)) >= clear) return solid;
  }
  return Solid(random);
}

std::unique_ptr<Shape> random_solid_shape(Random& random) {
  return std::make_unique<FieldShape>(random_solid(random));
}

}  // namespace bitr::generate
