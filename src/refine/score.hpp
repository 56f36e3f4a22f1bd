// How well a pose fits: see Refinement::score_before in bitr/refine.hpp.
#pragma once

#include <bitr/pose.hpp>

#include "refine/surface.hpp"
#include "refine/workers.hpp"

namespace bitr::refine {

struct Fit {
  double score = 0;
  double overlap = 0;       ///< share of the source's points with a counterpart
  double most_overlap = 0;  ///< the larger of the two clouds' shares
  double most_near = 0;     ///< the same within twice the length
  double rmse = 0;          ///< of their distances
  std::size_t inliers = 0;  ///< how many they are
};

/// The length beyond which points are not each other's counterparts.
double truncation(const Surface& source, const Surface& reference);

/// `T` takes the centred source to the centred reference. `oriented`: see MatchRule.
Fit measure(const Surface& source, const Surface& reference, const Pose& T, bool oriented,
            const Workers& workers);

}  // namespace bitr::refine
