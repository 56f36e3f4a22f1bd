#include "confidence/mean_pose.hpp"

#include "core/centroid.hpp"
#include "refine/rigid_fit.hpp"

namespace bitr::confidence {

using refine::nearest_rotation, refine::pose_of, refine::rotation_of, refine::vector;

MeanPose::MeanPose(const CloudPair& pair, const Assembly& first)
    : first_(first.T_reference_source),
      source_(vector(centroid_of(pair.source.positions))),
      reference_(vector(centroid_of(pair.reference.positions))) {
  add(first);
}

void MeanPose::add(const Assembly& answer) {
  const double weight = answer.diagnostics.rotation_gap;
  const Eigen::Matrix3d R = rotation_of(answer.T_reference_source);
  const Eigen::Vector3d t = vector(answer.T_reference_source.translation);
  rotations_ += weight * R;
  source_images_ += weight * (R * source_ + t);
  reference_images_ += weight * R.transpose() * (reference_ - t);
  weights_ += weight;
}

Pose MeanPose::pose() const {
  if (!(weights_ > 0)) return first_;
  const Eigen::Matrix3d R = nearest_rotation(rotations_);
  // Half of what either direction asks for.
  return pose_of(R, 0.5 * (source_images_ / weights_ - R * source_) +
                        0.5 * (reference_ - R * reference_images_ / weights_));
}

}  // namespace bitr::confidence
