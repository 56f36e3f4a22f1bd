// A plan's inside: the folded (or expanded) graph in one arithmetic type, behind a face without that type.
#pragma once

#include <bitr/assemble.hpp>

#include "cpu/executor.hpp"

namespace bitr {

/// Clouds of a batch in the order of graph::BatchLayout, with the centroid each was moved by.
struct PackedBatch {
  graph::BatchLayout layout;
  std::vector<const CloudView*> clouds;
  std::vector<Vec3d> centroids;
};

/// One pair as the network returned it, relative to the clouds' centroids; the rotation made orthonormal in
/// double.
struct RawPose {
  Pose T_reference_source;
  std::array<double, 3> singular_values;
  double determinant;
};

/// Runs a graph; reads tensors as doubles whatever the arithmetic.
class Runner {
 public:
  virtual ~Runner() = default;
  virtual void run(const PackedBatch& batch, cpu::ThreadPool& pool) = 0;
  virtual std::vector<double> tensor(graph::TensorId id) const = 0;
  virtual std::vector<std::uint32_t> indices(graph::TensorId id) const = 0;
  virtual const graph::Graph& graph() const = 0;
  virtual std::size_t workspace_bytes() const = 0;
  virtual const std::vector<double>& node_milliseconds() const = 0;
};

/// `retain`: every tensor can be read after a run.
Result<std::unique_ptr<Runner>> make_runner(const Model& model, Mode mode, const PlanOptions& options,
                                            bool retain);

struct Plan::Impl {
  Device device;
  Model model;
  BatchShape capacity;
  PlanOptions options;
  Mode mode;
  std::unique_ptr<Runner> runner;
  std::vector<StageTime> timings;

  /// Runs one batch and adds to the timings.
  void run(const PackedBatch& batch);
};

/// Checks clouds and lays out the batch (all sources, then all references). `invalid_argument` names the
/// cloud.
Result<PackedBatch> pack(const Plan::Impl& plan, std::span<const CloudPair> pairs);

/// Overlap and inliers at the found pose.
void measure_overlap(const CloudPair& pair, const Pose& T_reference_source, cpu::ThreadPool& pool,
                     Diagnostics& diagnostics);

/// Length of the bounding box's diagonal.
double diagonal(const Vec3View& points);

}  // namespace bitr
