// Registration by optimal transport: every source point is drawn to the mean of the reference points that
// the transport plan gives it, and the motion that follows these draws best is taken, again and again.
#pragma once

#include <bitr/pose.hpp>
#include <memory>
#include <span>
#include <vector>

#include "refine/sinkhorn.hpp"
#include "refine/stepper.hpp"

namespace bitr::refine {

/// Points, and normals that count as three more coordinates.
struct TransportCloud {
  const std::vector<Vec3d>& points;
  const std::vector<Vec3d>& normals;  ///< empty, or one unit vector per point
};

/// One width of the kernel.
struct TransportStage {
  Affinity affinity = {};
  double normal_length = 0;  ///< see BlockedPoints; 0: positions alone
  SinkhornOptions sinkhorn = {};
  double tolerance = 1e-6;  ///< it ends when (R, t) changes by less, in the Frobenius norm
  int most_iterations = 100;
  bool warm = false;  ///< every plan starts from the one before
};

struct TransportResult {
  Pose T_reference_source;
  int iterations = 0;      ///< over all stages
  bool converged = false;  ///< the last stage
  std::size_t workspace_bytes = 0;
};

/// The plan at a pose, and what Procrustes needs of it.
struct PlanWanted {
  Sinkhorn& plan;
  const TransportStage& stage;
  bool warm;  ///< from the potentials it has
  Eigen::ArrayXd weights;
  Eigen::ArrayXXd targets;  ///< both as of Sinkhorn::project()
};

/// On the CPU, with the plan's own workers.
void solve(PlanWanted& wanted);

/// One stage after the other; the default is the official code's only one. Clouds of at least three points,
/// in units that suit the affinities and near the origin.
TransportResult transport(const TransportCloud& source, const TransportCloud& reference, const Pose& start,
                          std::span<const TransportStage> stages, const Workers& workers = {});

/// The same step by step; clouds, stages and result outlive it.
std::unique_ptr<Stepper> transport_stepper(const TransportCloud& source, const TransportCloud& reference,
                                           const Pose& start, std::span<const TransportStage> stages,
                                           const Workers& workers, TransportResult& result);

/// Kernels that narrow from 4 spacings to one, for clouds in units of their spacing.
std::vector<TransportStage> narrowing_stages(bool normals);

}  // namespace bitr::refine
