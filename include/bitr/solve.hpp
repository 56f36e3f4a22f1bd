// Two clouds from anywhere: the pose that joins them, how far it can be trusted, and what else it could be.
#pragma once

#include <bitr/assemble.hpp>
#include <bitr/confidence.hpp>
#include <bitr/device.hpp>
#include <bitr/model.hpp>
#include <bitr/pose.hpp>
#include <bitr/restriction.hpp>
#include <bitr/result.hpp>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace bitr {

struct SolveOptions {
  /// Asked where the clouds' surfaces leave the pose in doubt, as those of pieces that only meet do: without a value,
  /// every model that ships; none: geometry alone. A network that reads normals is shown estimated ones where a cloud
  /// has none; one that reads colours is not asked.
  std::optional<std::vector<Model>> models = {};
  int answers =
      ResampleOptions()
          .answers;      ///< of each network for parts of the clouds, even; its pose is their mean. 0: none
  bool geometry = true;  ///< false: the networks' answers alone
  Restriction restriction = {};       ///< of every pose, in the clouds' own frames
  std::size_t most_alternatives = 4;  ///< poses returned beside the best
};

/// What a pose is judged by: both clouds look at each other, at one resolution. Shares are of a cloud's points;
/// nothing depends on units or frames.
struct SolveEvidence {
  double score =
      0;  ///< points with a counterpart, by its distance and the angle of their normals, of both clouds
          ///< together, as a share of the smaller; 0 … 1
  double source_overlap = 0,
         reference_overlap = 0;  ///< points nearer than 1.5 resolutions to the other cloud
  double residual = 0;           ///< root mean square distance of those across the surface, in resolutions
  double normals = 0;            ///< mean cosine of their normals, up to sign
  double conflict = 0;  ///< points that hover over the inside of the other's surface, as a share of them and
                        ///< those with a counterpart: one of the two should have been seen by both
  double slack = 0;     ///< how freely the surfaces slide or turn along each other: 0 not at all, 1 freely
  double margin = 0;  ///< how far the next distinct pose's score is below this one's, as a share of it; below
                      ///< 0 for a pose that is not the best
  double support = 0;  ///< matched points that proposed it
};

struct SolvedPose {
  Pose T_reference_source;  ///< x_reference = R x_source + t
  /// Estimated probability that the rotation is within `within_degrees` of the truth and the source's centroid within
  /// `within_share` of the joined object's diagonal of its place.
  double confidence = 0;
  double within_degrees = 5, within_share = 0.05;  ///< 20 and 0.1 for a network's pose, which nothing settled
  SolveEvidence evidence;
  std::string proposal;  ///< where it came from: "matches", "principal axes", or a model's name
};

struct Solution {
  SolvedPose best;
  std::vector<SolvedPose> alternatives;  ///< distinct from the best and from each other, best first
  std::vector<std::string> reasons;      ///< what lowers the confidence, most important first, for people
  double source_spacing = 0, reference_spacing = 0;  ///< median distances between neighbours
  double resolution = 0;  ///< of the level that was worked on, in the clouds' units
  std::size_t source_dropped = 0, reference_dropped = 0;  ///< points that were left out: not finite
  std::optional<Restricted> restricted;  ///< what became of the best pose, where a restriction was asked for
};

/// A pose whose confidence is less than this is in doubt.
inline constexpr double sure = 0.5;

/// Solves every pair: proposes poses, settles them on the clouds, judges them, asks networks where the best is in doubt,
/// and returns what is most likely. Poses move with the clouds; the same clouds give the same bits on any number of
/// threads, and alone or among others. Normals may be missing, or of either sign; points that are not finite are left
/// out. Where nothing can be said the confidence is 0, the best pose joins the centroids, and a reason says why.
/// Networks run on the device, geometry on the CPU threads that belong to it.
/// `invalid_argument` when a cloud has fewer than 3 finite points or normals that are not one per point, or for an
/// option out of its range; `device_lost` and `internal` as of assemble().
Result<std::vector<Solution>> solve(const Device& device, std::span<const CloudPair> pairs,
                                    const SolveOptions& options = {});

}  // namespace bitr
