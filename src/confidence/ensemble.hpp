// Several passes over the same pair, taken together.
#pragma once

#include <bitr/confidence.hpp>
#include <vector>

namespace bitr::confidence {

/// A network's assemblies of the same two clouds or of parts of them.
class Ensemble {
 public:
  explicit Ensemble(const CloudPair& pair);

  /// Also a failed one: see NetworkEvidence.
  void add(const Assembly& member);

  /// At least one member has been added. The pose is the first one's while no gap adds up to anything.
  NetworkEvidence together() const;

 private:
  struct Member {
    Pose T_reference_source;
    double gap = 0;
  };
  Pose mean() const;
  double translation_spread(const Pose& mean) const;

  std::vector<Member> members_;  // but the failed ones
  std::size_t failed_ = 0;
  Vec3d source_, reference_;  // centroids
  double radius_ = 0;         // see NetworkEvidence::translation_spread
};

}  // namespace bitr::confidence
