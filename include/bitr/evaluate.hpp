// How far poses are from the truth, and what many of them amount to.
#pragma once

#include <bitr/data.hpp>
#include <bitr/pose.hpp>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

namespace bitr {

/// Neither depends on the frames in which the two clouds happen to be given.
struct PoseErrors {
  double rotation = 0;     ///< Δr: isotropic rotation error in degrees, 0 … 180
  double translation = 0;  ///< Δt: how far the pose takes the object's origin from its place, in model units
  double translation_fraction = 0;  ///< Δt over object_diagonal()
  bool failed = false;  ///< the pose holds a number that is not finite: counted as 180° and one diagonal
};

/// Against the nearest of the poses that the object's symmetry makes equally true. A turn of the object is
/// about its origin, so Δt is the same for all of them.
PoseErrors errors_of(const Pose& T_reference_source, const DataSample& sample);

/// The diagonal of the box around both clouds, joined by the truth, in the object's own frame; model units.
double object_diagonal(const DataSample& sample);

struct Distribution {
  double mean = 0, std = 0,
         median = 0;        ///< std divides by n; an even number's median is its middle two's mean
  double median_error = 0;  ///< standard error of the median, from the order statistics n/2 ± √n/2
};

struct ErrorSummary {
  std::size_t pairs = 0;
  std::size_t failed = 0;  ///< so many of the pairs, see PoseErrors
  Distribution rotation, translation, translation_fraction;

  // Shares of the pairs, 0 … 1.
  double success_5 = 0;                               ///< Δr ≤ 5° and Δt ≤ 0.1 diagonals
  double success_15 = 0;                              ///< Δr ≤ 15° and Δt ≤ 0.3 diagonals
  double recall_5 = 0, recall_10 = 0, recall_20 = 0;  ///< Δr ≤ 5°, 10°, 20°
  double flips = 0;                                   ///< Δr > 135°
};

/// All zeros for no pairs.
ErrorSummary summarise(std::span<const PoseErrors> errors);

/// Δr ≤ 20° and Δt ≤ 0.1 diagonals: what Confidence::value is the probability of.
bool near_truth(const PoseErrors& errors);

/// A pose's confidence, and whether it was near_truth().
struct Judgement {
  double confidence = 0;
  bool right = false;
};

/// Poses whose confidence is in [low, high), 1 in the last.
struct ConfidenceBin {
  double low = 0, high = 0;
  std::size_t poses = 0;
  double said = 0;  ///< mean confidence
  double was = 0;   ///< share that was right
};

struct ConfidenceSummary {
  std::size_t poses = 0;
  double said = 0, was = 0;    ///< means over all poses, as in a bin
  std::optional<double> area;  ///< under the ROC curve: the chance that a right pose has more confidence than
                               ///< a wrong one, ties half; empty when all are right or all wrong
  std::vector<ConfidenceBin> bins;  ///< tenths that have poses
};
ConfidenceSummary summarise_confidence(std::span<const Judgement> judgements);

}  // namespace bitr
