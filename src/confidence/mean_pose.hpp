// One pose made of several answers for the same pair.
#pragma once

#include <Eigen/Core>
#include <bitr/assemble.hpp>

namespace bitr::confidence {

/// As told of NetworkEvidence::T_reference_source.
class MeanPose {
 public:
  MeanPose(const CloudPair& pair, const Assembly& first);

  /// One that is not failed.
  void add(const Assembly& answer);

  /// The first answer while no gap adds up to anything.
  Pose pose() const;

 private:
  Pose first_;
  Eigen::Vector3d source_, reference_;  // centroids
  Eigen::Matrix3d rotations_ = Eigen::Matrix3d::Zero();
  Eigen::Vector3d source_images_ = Eigen::Vector3d::Zero(), reference_images_ = Eigen::Vector3d::Zero();
  double weights_ = 0;
};

}  // namespace bitr::confidence
