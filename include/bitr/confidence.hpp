// How far a pose can be trusted: what speaks for and against it, and one calibrated number made of that.
#pragma once

#include <bitr/assemble.hpp>
#include <bitr/device.hpp>
#include <bitr/pose.hpp>
#include <bitr/result.hpp>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace bitr {

/// What a network says of the clouds and of random parts of them, taken together. A failed answer for a part
/// counts as a gap of 0 and half a turn, and has no place.
struct NetworkEvidence {
  /// Mean of its answers: nearer the truth than the answer for the clouds as they are (docs/confidence.md).
  /// Rotations count by their gaps; the translation brings the clouds' centroids where the answers do on
  /// average, in both directions alike. So it turns with the clouds, and swapping them inverts it.
  Pose T_reference_source;
  double rotation_gap = 0;     ///< mean of the answers': see Diagnostics
  double rotation_spread = 0;  ///< median angle in degrees between the answers and their mean
  /// How far from where the mean brings the clouds' centroids the answers bring them: root mean square over
  /// answers and both directions, as a share of the clouds' radius, √ of the sum of both clouds' mean squared
  /// distances from their centroids.
  double translation_spread = 0;
};

struct ResampleOptions {
  int answers = 8;         ///< for parts of the clouds, an even number in 2 … 100
  double share = 0.9;      ///< share of a cloud's points in a part, above 0 and below 1
  std::uint64_t seed = 0;  ///< same seed, same parts
};

/// Larger parts than this tell no more.
inline constexpr std::size_t most_resampled = 2048;

/// Runs the plan again on parts of the clouds: share · N points, but within what the model was trained on
/// where the clouds allow that, at most 0.95 N and most_resampled. Empty for a pair whose assembly failed or
/// whose clouds have hardly more points than the model needs. `assemblies` are the plan's answers for the
/// pairs, without complete matching, which needs the same points in both clouds. Errors as of assemble(), and
/// `invalid_argument` for an option out of its range.
Result<std::vector<std::optional<NetworkEvidence>>> resample(Plan& plan, std::span<const CloudPair> pairs,
                                                             std::span<const Assembly> assemblies,
                                                             const ResampleOptions& options = {});

/// What a pose is judged by. Nothing here depends on units or on the frames of the clouds.
struct Evidence {
  double score = 0;    ///< see refinement_score
  double overlap = 0;  ///< Refinement::overlap_before of the pose: the larger of the clouds' shares
  /// How near the rims, where a cloud's surface ends, are to the other cloud: the mean over the rims' points
  /// of 1 − (d/2τ)², at least 0; empty without rims. What clouds that only meet have in common. τ is that of
  /// the score (refine.hpp).
  std::optional<double> rims;
  /// Share of the points that lie under the other cloud's surface, 0.6 τ in or more and right below its
  /// nearest point; 0 where the clouds have no oriented normals. Does not count for the value.
  double interpenetration = 0;
  /// As in NetworkEvidence; empty without.
  std::optional<double> rotation_gap, rotation_spread, translation_spread;
  std::optional<double> refined_by;  ///< angle in degrees between the network's answer and the pose, where
                                     ///< they differ
};

struct Confidence {
  /// Estimated probability of near_truth (evaluate.hpp): that the rotation is within 20° of the truth and the
  /// object's centre within a tenth of the joined object's diagonal of its place, near enough for refinement
  /// to bring it home. 0 where a network's rotation is not determined: a rotation_gap below 1e-3.
  double value = 0;
  /// What lowers it, most important first, for people; empty when nothing does.
  std::vector<std::string> reasons;
  Evidence evidence;
};

/// Judges T_reference_source of each pair: answers of a network or what became of them, with `network` (what
/// resample() returned), or any poses without it. Runs on the device's CPU threads; results do not depend on
/// their number. A pose that is not finite gets 0. `invalid_argument` when counts differ, and as of
/// refine_poses().
Result<std::vector<Confidence>> judge_poses(const Device& device, std::span<const CloudPair> pairs,
                                            std::span<const Pose> poses,
                                            std::span<const std::optional<NetworkEvidence>> network = {});

}  // namespace bitr
