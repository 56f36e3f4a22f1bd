#include "refine/transport.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "refine/rigid_fit.hpp"

namespace bitr::refine {
namespace {

// Added to sums of weights, which are 0 where nothing has a counterpart (as in the official code).
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

class Steps : public Stepper {
 public:
  Steps(const TransportCloud& source, const TransportCloud& reference, const Pose& start,
        std::span<const TransportStage> stages, const Workers& workers, TransportResult& result)
      : source_(source), reference_(reference), stages_(stages), workers_(workers), result_(result) {
    result_ = {};
    result_.T_reference_source = start;
  }

  Wanted wanted() override {
    if (stages_.empty()) return {};
    if (!plan_) begin_stage();
    while (iterations_ >= stages_.front().most_iterations || result_.converged || hopeless_) {
      end_stage();
      if (stages_.empty()) return {};
      begin_stage();
    }
    plan_->move_source(result_.T_reference_source);
    wanted_.emplace(PlanWanted{*plan_, stages_.front(), stages_.front().warm && iterations_ > 0, {}, {}});
    return {{}, &*wanted_};
  }

  void step() override {
    ++result_.iterations;
    ++iterations_;
    auto& [plan, stage, warm, weights, targets] = *wanted_;
    targets.colwise() /= weights + least_weight;
    const double total = weights.sum();
    hopeless_ = !(total > 0);
    if (hopeless_) return;
    weights /= total + least_weight;
    const Pose next = fit(from_, weights, targets.matrix());
    result_.converged = frobenius_change(next, result_.T_reference_source) < stage.tolerance;
    result_.T_reference_source = next;
  }

 private:
  void begin_stage() {
    static const std::vector<Vec3d> none;
    const double length = stages_.front().normal_length;
    const auto blocked = [&](const TransportCloud& cloud) {
      return BlockedPoints(cloud.points, length > 0 ? cloud.normals : none, length);
    };
    plan_.emplace(blocked(source_), blocked(reference_), workers_);
    from_ = plan_->source().rows();
    iterations_ = 0;
    result_.converged = false;
    hopeless_ = false;
  }
  void end_stage() {
    const std::size_t bytes = plan_->bytes() + sizeof(double) * static_cast<std::size_t>(from_.size());
    if (!hopeless_) result_.workspace_bytes = std::max(result_.workspace_bytes, bytes);
    stages_ = stages_.subspan(1);
  }

  const TransportCloud source_, reference_;
  std::span<const TransportStage> stages_;  // this one and those to come
  const Workers workers_;
  TransportResult& result_;
  std::optional<Sinkhorn> plan_;
  Eigen::MatrixXd from_;
  std::optional<PlanWanted> wanted_;
  int iterations_ = 0;     // in this stage
  bool hopeless_ = false;  // the slack takes everything
};

}  // namespace

void solve(PlanWanted& wanted) {
  wanted.plan.normalise(wanted.stage.affinity, wanted.stage.sinkhorn, wanted.warm);
  wanted.plan.project(wanted.weights, wanted.targets);
}

std::unique_ptr<Stepper> transport_stepper(const TransportCloud& source, const TransportCloud& reference,
                                           const Pose& start, std::span<const TransportStage> stages,
                                           const Workers& workers, TransportResult& result) {
  return std::make_unique<Steps>(source, reference, start, stages, workers, result);
}

TransportResult transport(const TransportCloud& source, const TransportCloud& reference, const Pose& start,
                          std::span<const TransportStage> stages, const Workers& workers) {
  TransportResult result;
  Steps steps(source, reference, start, stages, workers, result);
  drive(steps, workers);
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
