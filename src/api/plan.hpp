// A plan's inside.
#pragma once

#include <chrono>

#include "api/executor.hpp"
#include "api/pack.hpp"
#include "core/thread_pool.hpp"

namespace bitr {

/// One pair as the network returned it, relative to the clouds' centroids; the rotation made orthonormal in
/// double.
struct RawPose {
  Pose T_reference_source;
  std::array<double, 3> singular_values;
  double determinant;
};

/// Below this share of the largest singular value the rotation is decided by rounding noise.
inline constexpr double least_rotation_gap = 1e-3;

struct Plan::Impl {
  using Clock = std::chrono::steady_clock;

  Device device;
  Model model;
  BatchShape capacity;
  PlanOptions options;
  Mode mode;
  std::unique_ptr<graph::Executor> executor;
  std::vector<StageTime> timings = {};
  std::vector<StageTime> profile = {};
  std::vector<StageTime> passes = {};  ///< whole ones, by the host's clock
  Clock::time_point began = {};

  /// Forgets the times of the last assemble().
  void begin();
  /// Runs one batch and adds to the times.
  void run(const PackedBatch& batch);
};

/// Overlap and inliers at the found pose.
void measure_overlap(const CloudPair& pair, const Pose& T_reference_source, ThreadPool& pool,
                     Diagnostics& diagnostics);

/// Length of the bounding box's diagonal.
double diagonal(const Vec3View& points);

}  // namespace bitr
