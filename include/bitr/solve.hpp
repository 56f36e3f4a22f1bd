// Two clouds from anywhere: the pose that joins them, how far it can be trusted, and what else it could be.
#pragma once

#include <bitr/assemble.hpp>
#include <bitr/device.hpp>
#include <bitr/pose.hpp>
#include <bitr/result.hpp>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace bitr {

struct SolveOptions {
  /// Networks whose answers are proposals too, beside those of the clouds' geometry. A cloud without normals
  /// shows them estimated ones. The plans' own capacity must hold one pair of `network_points` each.
  std::span<Plan* const> networks = {};
  std::size_t network_points = 1024;  ///< of each cloud, at most
  bool geometry = true;               ///< false: the networks' proposals alone
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
  /// Estimated probability that the rotation is within 5° of the truth and the source's centroid within 5 % of
  /// the joined object's diagonal of its place.
  double confidence = 0;
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
};

/// Solves every pair: proposes poses, settles them on the clouds, judges them and returns the best. Poses move
/// with the clouds; the same clouds give the same bits on any number of threads, and alone or among others.
/// Normals may be missing, or of either sign; points that are not finite are left out. Where nothing can be
/// said the confidence is 0, the best pose joins the centroids, and a reason says why.
/// `invalid_argument` when a cloud has fewer than 3 finite points or normals that are not one per point; of
/// networks, errors as of assemble() make their proposals missing, nothing more.
Result<std::vector<Solution>> solve(const Device& device, std::span<const CloudPair> pairs,
                                    const SolveOptions& options = {});

}  // namespace bitr
