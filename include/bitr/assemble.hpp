// From pairs of clouds to poses.
#pragma once

#include <array>
#include <bitr/cloud.hpp>
#include <bitr/device.hpp>
#include <bitr/model.hpp>
#include <bitr/neighbor_search.hpp>
#include <bitr/pose.hpp>
#include <bitr/result.hpp>
#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace bitr {

/// Source X and reference Y, each in a frame and pose of its own, in the same units. N ≠ M is fine, and they
/// need not overlap.
struct CloudPair {
  CloudView source;
  CloudView reference;
  /// Where the sensor stood, in the frame of its cloud, if it is known: estimated normals point there. For solve() alone.
  std::optional<Vec3d> source_viewpoint = {}, reference_viewpoint = {};
};

enum class Precision { f32, f64 };

struct PlanOptions {
  Precision precision = Precision::f32;
  std::optional<Mode> mode = {};  ///< overrides the model's
  bool as_defined = false;  ///< evaluate the network as the paper states it, nothing folded: slow, the truth
  NeighborSearch neighbors = NeighborSearch::automatic;  ///< within each cloud; the poses are the same
};

/// What a plan can hold at once: pairs, and the points of all their clouds together.
struct BatchShape {
  std::size_t pairs = 1;
  std::size_t points = 0;
};

struct AssembleOptions {
  bool complete_match = false;  ///< return f(X,Y)∘f(X,X): exact when Y is a moved copy of X, for any weights
  bool diagnostics = true;      ///< overlap and inlier RMSE (needs neighbour searches between the clouds)
  bool swap_residual = false;   ///< also evaluate f(Y,X): as much work again
};

/// The capacity that `assemble` needs for these pairs, whatever its options.
BatchShape shape_of(std::span<const CloudPair> pairs);

enum class Status {
  ok,
  degenerate,  ///< the pose is not determined by the clouds: see `reason`
  failed,      ///< a non-finite number appeared; the pose holds NaN
};

struct Diagnostics {
  std::array<double, 3> singular_values{};  ///< those of r̂ / max(|r̂|, 1e-5), descending
  /// (s₂ ± s₃)/s₁ with the sign of det r̂: the distance of the rotation from being ambiguous, in [0, 2].
  double rotation_gap = 0;
  bool degenerate = false;
  std::string reason;  ///< empty when not degenerate
  /// Share of the source's points with a reference point within inlier_threshold, at the pose found: distances
  /// only. (Refinement and Evidence count counterparts, within another length; GeneratedPair knows the truth.)
  std::optional<double> overlap;
  std::optional<double> inlier_rmse;  ///< over those points, in the clouds' units; empty if there are none
  std::optional<double> inlier_threshold;  ///< twice the larger of the clouds' median neighbour distances
  std::optional<double> swap_residual;  ///< |f(X,Y)∘f(Y,X) − I|, translations in units of the reference's
                                        ///< diagonal: 0 but for rounding
};

struct Assembly {
  Status status = Status::ok;
  Pose T_reference_source;  ///< x_reference = R x_source + t
  Diagnostics diagnostics;
  std::vector<Vec3d> source_key_points;     ///< num_key_points, in the source's frame
  std::vector<Vec3d> reference_key_points;  ///< num_key_points, in the reference's frame
};

struct StageTime {
  std::string stage;
  double milliseconds = 0;
  double start_ms = 0;   ///< since the first forward pass of the assemble() began
  std::size_t pass = 0;  ///< which forward pass of the assemble(), from 0
};

/// What one forward pass asks of a Vulkan device: the same on every device of a tier, whatever the times.
struct PlanCounters {
  std::size_t dispatches = 0;   ///< kernels started
  std::size_t copies = 0;       ///< inputs to the device, outputs back
  std::size_t barriers = 0;     ///< where kernels wait for earlier ones
  std::size_t submissions = 0;  ///< to the queue
};

/// A model made ready for one device: folded weights, schedule and workspace. Belongs to one thread at a
/// time.
class Plan {
 public:
  const Device& device() const;
  const Model& model() const;
  const PlanOptions& options() const;
  Mode mode() const;
  BatchShape capacity() const;
  /// Memory held for tensors. On the CPU 0 before the first assemble(), then what the largest batch took. On
  /// a Vulkan device what the capacity takes, with buffers for input and output, all of it from the start.
  std::size_t workspace_bytes() const;
  std::size_t operation_count() const;            ///< operations a forward pass runs
  const std::vector<StageTime>& timings() const;  ///< the last assemble()'s stages, summed over its passes
  /// Every operation of the last assemble(), in the order they ran. Durations are 0 where a GPU has no clock.
  const std::vector<StageTime>& profile() const;
  /// What the last forward pass asked of the device; zeros on the CPU.
  PlanCounters counters() const;

  struct Impl;
  Plan(Plan&&) noexcept;
  Plan& operator=(Plan&&) noexcept;
  ~Plan();

 private:
  friend struct Internal;
  explicit Plan(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// `invalid_argument` when the capacity is 0 or beyond 2³²/64 pairs or points; `unsupported` for f64 or
/// as_defined on a Vulkan device, which runs the folded network in f32 only; `internal` when memory, the
/// device's included, runs out; `device_lost`.
Result<Plan> make_plan(const Device& device, const Model& model, const BatchShape& capacity,
                       const PlanOptions& options = {});

/// Assembles every pair. Poses are computed relative to the clouds' centroids, so large coordinates lose
/// nothing. `invalid_argument` when a cloud has fewer than max(k_neighbor + 1, key_mean_num) points, a
/// non-finite coordinate, no extent or one beyond the precision (1e-15 … 1e15 in f32, 1e±120 in f64), lacks
/// the normals or colours the model reads, or the batch exceeds the plan's capacity; the message names the
/// pair and the cloud. `device_lost` names the last kernel that was started; nothing waits for ever, and a
/// new device can be made in the same process.
Result<std::vector<Assembly>> assemble(Plan& plan, std::span<const CloudPair> pairs,
                                       const AssembleOptions& options = {});

/// Runs one tiny pair, so that a driver compiles every kernel now and not in the first assemble().
/// `invalid_argument` when the plan's capacity is too small for any pair.
Result<void> prewarm(Plan& plan);

/// Plan::profile() in Chrome's trace-event JSON, for ui.perfetto.dev or chrome://tracing.
std::string chrome_trace(const Plan& plan);

/// One stage of the network, compared with its definition.
struct StageDifference {
  std::string stage;
  double difference = 0;  ///< largest absolute difference over the largest absolute entry
  double bound = 0;       ///< what the plan's precision is held to
  bool within() const { return difference <= bound; }
};

/// Runs the pair through the plan and, as defined and in double precision, through the CPU; compares every
/// stage that both compute, and the rotation ("out.R") and translation ("out.t").
Result<std::vector<StageDifference>> verify(Plan& plan, const CloudPair& pair);

}  // namespace bitr
