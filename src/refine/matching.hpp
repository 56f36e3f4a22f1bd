// Corresponding points of two surfaces, looked for from both sides.
#pragma once

#include <Eigen/Core>
#include <bitr/pose.hpp>
#include <vector>

#include "refine/surface.hpp"
#include "refine/workers.hpp"

namespace bitr::refine {

/// A point of either cloud and its counterpart, in the reference's centred frame.
struct Match {
  Eigen::Vector3d source, reference;
  Eigen::Vector3d source_normal, reference_normal;  ///< zero without normals
  double squared = 0;  ///< |source − reference|² + λ²|difference of the normals|²
  std::uint32_t order = 0;
};

struct MatchRule {
  /// λ, how far apart normals that differ by 1 (60°) put two points; 0: nearest points, whatever their
  /// normals.
  double normal_length = 0;
  bool oriented = true;  ///< normals tell the surface's sides apart; otherwise their signs mean nothing
};

/// `T` takes the centred source to the centred reference. First a match for every asked point of the source,
/// then of the reference, in their order. Both surfaces have normals or neither.
void match(const Surface& source, const Surface& reference, const Pose& T, const MatchRule& rule,
           const Workers& workers, std::vector<Match>& matches);

/// Whether normals tell the two sides of the surfaces apart. Those that were estimated without a viewpoint do
/// not: of nearest points, many then have opposite ones. True without normals.
bool normals_are_oriented(const Surface& source, const Surface& reference, const Pose& T,
                          const Workers& workers);

}  // namespace bitr::refine
