// How well a pose fits: see Refinement::score_before in bitr/refine.hpp.
#pragma once

#include <bitr/pose.hpp>
#include <vector>

#include "refine/stepper.hpp"
#include "refine/surface.hpp"

namespace bitr::refine {

struct Fit {
  double score = 0;
  double overlap = 0;       ///< share of the source's points with a counterpart
  double most_overlap = 0;  ///< the larger of the two clouds' shares
  double most_near = 0;     ///< the same within twice the length
  double rmse = 0;          ///< root mean square of the inliers' distances
  std::size_t inliers = 0;  ///< the source's points with a counterpart
};

/// The length beyond which points are not each other's counterparts.
double truncation(const Surface& source, const Surface& reference);

class Measurement {
 public:
  /// `T` takes the centred source to the centred reference. `oriented`: see MatchRule. The surfaces outlive
  /// it.
  Measurement(const Surface& source, const Surface& reference, const Pose& T, bool oriented)
      : source_(source), reference_(reference), T_(T), oriented_(oriented) {}
  /// What fit() needs.
  std::vector<Search> searches();
  Fit fit() const;

 private:
  struct Residual {
    double squared = 0;  ///< distance
    double turned = 0;   ///< |difference of the normals|², 0 without
  };
  Search look(const Surface& from, const Surface& to, const Pose& T, std::vector<Residual>& residuals) const;

  const Surface &source_, &reference_;
  const Pose T_;
  const bool oriented_;
  std::vector<Residual> of_source_, of_reference_;
};

}  // namespace bitr::refine
