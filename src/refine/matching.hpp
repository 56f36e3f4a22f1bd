// Corresponding points of two surfaces, looked for from both sides.
#pragma once

#include <Eigen/Core>
#include <bitr/pose.hpp>
#include <vector>

#include "refine/stepper.hpp"
#include "refine/surface.hpp"

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

/// What fills `matches` at T, which takes the centred source to the centred reference: a match for every
/// asked point of the source, then of the reference, in their order. Both surfaces have normals or neither;
/// surfaces and matches outlive it.
std::vector<Search> match(const Surface& source, const Surface& reference, const Pose& T,
                          const MatchRule& rule, std::vector<Match>& matches);

/// Whether normals tell the two sides of the surfaces apart, by matches of nearest points. Those that were
/// estimated without a viewpoint do not: many matches then have opposite ones.
bool normals_are_oriented(const std::vector<Match>& matches);

}  // namespace bitr::refine
