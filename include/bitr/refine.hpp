// Refinement: from a pose that is about right to one that fits the clouds, and never to a worse one.
#pragma once

#include <bitr/assemble.hpp>
#include <bitr/device.hpp>
#include <bitr/pose.hpp>
#include <bitr/result.hpp>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace bitr {

enum class RefineMethod : std::uint8_t {
  icp,        ///< nearest neighbours are corresponding points, the worst of them left out
  transport,  ///< optimal transport: every point is shared out among several, with a slack for the rest
};

enum class RefineProtocol : std::uint8_t {
  /// This library's own: thresholds are multiples of the clouds' spacing, what has a counterpart is
  /// estimated, normals are used when both clouds have them. Nothing depends on units or frames.
  adaptive,
  /// The official code's constants and stopping rules, which suit clouds of about unit size near the origin;
  /// positions only.
  official,
};

struct RefineOptions {
  RefineMethod method = RefineMethod::icp;
  RefineProtocol protocol = RefineProtocol::adaptive;
  /// For ICP: the share of the smaller cloud's points that has a counterpart, above 0 and up to 1. Empty:
  /// estimated (adaptive), 0.8 (official).
  std::optional<double> keep = {};
  /// For the adaptive protocol: where Refinement::overlap_before is smaller, there is nothing to refine on
  /// and the start is returned: clouds that only meet would be pulled over one another. The same when less
  /// than half of the proposal's overlap was nearer than 2τ at the start. 0 … 1; 0: never.
  double least_overlap = 0.2;
  /// 1 … 100,000, for transport in each stage; empty: the protocol's.
  std::optional<int> most_iterations = {};
  /// Where only some rigid motions will do: takes what the method ended with to one of them, before it is
  /// judged against the start, which should be one too. Several threads may call it at once. Empty: every
  /// rigid motion will do.
  std::function<Pose(const Pose&)> within = {};
};

/// "icp", "ot".
std::string_view name(RefineMethod method);
/// "default", "official".
std::string_view name(RefineProtocol protocol);

struct Refinement {
  Pose start;
  /// The better of start and proposal by their scores; the start when they are equal.
  Pose T_reference_source;
  bool improved = false;  ///< it is the proposal
  std::string reason;     ///< why it is not; empty when it is
  Pose proposal;          ///< what the method ended with; the start when it was not run

  /// Truncated residuals both ways, in [0, 1], 1 the best: the mean over all points of both clouds of
  /// 1 − min(1, (d/τ)² + |n − n'|²), where d is the distance to the other cloud's nearest point and n, n' are
  /// the two points' unit normals, where both clouds have them. τ is three times the larger of the clouds'
  /// spacings, in clouds of N > 512 points times √(N/512).
  double score_before = 0, score_after = 0;  ///< the start's and the proposal's

  int iterations = 0;
  bool converged = false;  ///< stopped before the most iterations
  /// A point has a counterpart where the other cloud's nearest point is nearer than τ and, where both clouds
  /// have normals, turned by less than 60°. At the start: the share of a cloud's points that have one, of the
  /// cloud where it is larger.
  double overlap_before = 0;
  double overlap = 0;               ///< share of the source's points with a counterpart, at the pose returned
  std::optional<double> rmse;       ///< root mean square of their distances; empty when there is none
  double spacing = 0;               ///< the larger of the clouds' median distances between neighbours
  std::size_t workspace_bytes = 0;  ///< host memory taken beside the clouds: linear in their points
};

/// Refines starts[i] on pairs[i], on the device: Vulkan is asked for the nearest points, or for the sums over
/// transport plans, of all pairs together, in single precision, and the rest is done on the host's threads in
/// double, so that results are the CPU's but for rounding. They do not depend on the number of threads or on
/// what else is in the call.
/// `invalid_argument` when the counts differ, a cloud has fewer than 3 points, a coordinate or a start is not
/// finite, normals are not one per point, or an option is out of its range; the message names the pair. On
/// Vulkan also `device_lost`, or `internal` when its memory runs out.
Result<std::vector<Refinement>> refine_poses(const Device& device, std::span<const CloudPair> pairs,
                                             std::span<const Pose> starts, const RefineOptions& options = {});

/// The score alone.
Result<double> refinement_score(const Device& device, const CloudPair& pair, const Pose& T_reference_source);

}  // namespace bitr
