#include "refine/transport.hpp"

#include <algorithm>
#include <cmath>

#include "refine/rigid_fit.hpp"

namespace bitr::refine {
namespace {

// Of weights, where nothing has a counterpart (as in the official code).
constexpr double least_weight = 1e-5;

double frobenius_change(const Pose& a, const Pose& b) {
  double sum = 0;
  for (int i = 0; i < 9; ++i) sum += (a.rotation[i] - b.rotation[i]) * (a.rotation[i] - b.rotation[i]);
  for (int i = 0; i < 3; ++i)
    sum += (a.translation[i] - b.translation[i]) * (a.translation[i] - b.translation[i]);
  return std::sqrt(sum);
}

/// The motion that takes rows of `from` to their targets, by weight (Procrustes). Columns beyond the third
/// are directions, which turn and do not shift.
Pose fit(const Eigen::MatrixXd& from, const Eigen::ArrayXd& weights, const Eigen::MatrixXd& targets) {
  const Eigen::Vector3d from_mean = from.leftCols<3>().transpose() * weights.matrix(),
                        to_mean = targets.leftCols<3>().transpose() * weights.matrix();
  Eigen::Matrix3d covariance = (targets.leftCols<3>().rowwise() - to_mean.transpose()).transpose() *
                               weights.matrix().asDiagonal() *
                               (from.leftCols<3>().rowwise() - from_mean.transpose());
  if (from.cols() > 3)
    covariance += targets.rightCols<3>().transpose() * weights.matrix().asDiagonal() * from.rightCols<3>();
  const Eigen::Matrix3d R = nearest_rotation(covariance);
  return pose_of(R, to_mean - R * from_mean);
}

void run(const TransportCloud& source, const TransportCloud& reference, const TransportStage& stage,
         const Workers& workers, TransportResult& result) {
  static const std::vector<Vec3d> none;
  const bool normals = stage.normal_length > 0;
  const auto blocked = [&](const TransportCloud& cloud) {
    return BlockedPoints(cloud.points, normals ? cloud.normals : none, stage.normal_length);
  };
  Sinkhorn plan(blocked(source), blocked(reference), workers);
  const Eigen::MatrixXd from = plan.source().rows();
  Eigen::ArrayXd weights;
  Eigen::ArrayXXd targets;
  result.converged = false;
  for (int i = 0; i < stage.most_iterations && !result.converged; ++i) {
    ++result.iterations;
    plan.move_source(result.T_reference_source);
    plan.normalise(stage.affinity, stage.sinkhorn, stage.warm && i > 0);
    plan.project(weights, targets);
    targets.colwise() /= weights + least_weight;
    const double total = weights.sum();
    if (!(total > 0)) return;
    weights /= total + least_weight;
    const Pose next = fit(from, weights, targets.matrix());
    result.converged = frobenius_change(next, result.T_reference_source) < stage.tolerance;
    result.T_reference_source = next;
  }
  const std::size_t bytes = plan.bytes() + sizeof(double) * static_cast<std::size_t>(from.size());
  result.workspace_bytes = std::max(result.workspace_bytes, bytes);
}

}  // namespace

TransportResult transport(const TransportCloud& source, const TransportCloud& reference, const Pose& start,
                          std::span<const TransportStage> stages, const Workers& workers) {
  TransportResult result;
  result.T_reference_source = start;
  for (const TransportStage& stage : stages) run(source, reference, stage, workers, result);
  return result;
}

std::vector<TransportStage> narrowing_stages(bool normals) {
  std::vector<TransportStage> stages;
  for (const double width : {4.0, 2.8, 2.0, 1.4, 1.0})
    stages.push_back({.affinity = {.beta = 1 / (2 * width * width), .alpha = 1.5 * width * width},
                      .normal_length = normals ? 8.0 : 0.0,
                      .sinkhorn = {.most_iterations = 20, .tolerance = 1e-2},
                      .tolerance = 3e-4,
                      .most_iterations = 10,
                      .warm = true});
  return stages;
}

}  // namespace bitr::refine
