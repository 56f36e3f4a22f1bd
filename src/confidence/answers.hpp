// Several answers for the same pair, taken together.
#pragma once

#include <bitr/confidence.hpp>
#include <vector>

namespace bitr::confidence {

/// A network's answers for the same two clouds.
class Answers {
 public:
  explicit Answers(const CloudPair& pair);

  /// Also a failed one: see NetworkEvidence.
  void add(const Assembly& answer);

  /// Of at least one answer; its pose is the first answer's while no gap adds up to anything.
  NetworkEvidence together() const;

 private:
  struct Answer {
    Pose T_reference_source;
    double gap = 0;
  };
  Pose mean() const;
  double translation_spread(const Pose& mean) const;

  std::vector<Answer> answers_;  // but the failed ones
  std::size_t failed_ = 0;
  Vec3d source_, reference_;  // centroids
  double radius_ = 0;         // see NetworkEvidence::translation_spread
};

}  // namespace bitr::confidence
