#include "confidence/ensemble.hpp"

#include <cmath>

#include "core/centroid.hpp"
#include "core/median.hpp"
#include "refine/rigid_fit.hpp"

namespace bitr::confidence {
namespace {

using refine::nearest_rotation, refine::pose_of, refine::rotation_of, refine::vector;

double squared_distance(const Vec3d& a, const Vec3d& b) { return (vector(a) - vector(b)).squaredNorm(); }

double mean_squared_distance(const Vec3View& positions, const Vec3d& centroid) {
  double sum = 0;
  for (std::size_t i = 0; i < positions.count; ++i) sum += squared_distance(positions[i], centroid);
  return sum / static_cast<double>(positions.count);
}

}  // namespace

Ensemble::Ensemble(const CloudPair& pair)
    : source_(centroid_of(pair.source.positions)),
      reference_(centroid_of(pair.reference.positions)),
      radius_(std::sqrt(mean_squared_distance(pair.source.positions, source_) +
                        mean_squared_distance(pair.reference.positions, reference_))) {}

void Ensemble::add(const Assembly& member) {
  if (member.status == Status::failed)
    ++failed_;
  else
    members_.push_back({member.T_reference_source, member.diagnostics.rotation_gap});
}

NetworkEvidence Ensemble::together() const {
  NetworkEvidence evidence{.T_reference_source = mean()};
  std::vector<double> angles(failed_, 180);
  for (const Member& member : members_) {
    evidence.rotation_gap += member.gap / static_cast<double>(members_.size() + failed_);
    angles.push_back(rotation_error_degrees(member.T_reference_source, evidence.T_reference_source));
  }
  evidence.rotation_spread = median(std::move(angles));
  evidence.translation_spread = translation_spread(evidence.T_reference_source);
  return evidence;
}

Pose Ensemble::mean() const {
  Eigen::Matrix3d rotations = Eigen::Matrix3d::Zero();
  Eigen::Vector3d source_images = Eigen::Vector3d::Zero(), reference_images = source_images;
  double weights = 0;
  for (const auto& [pose, gap] : members_) {
    rotations += gap * rotation_of(pose);
    source_images += gap * vector(pose.apply(source_));
    reference_images += gap * vector(pose.inverse().apply(reference_));
    weights += gap;
  }
  if (!(weights > 0)) return members_.front().T_reference_source;
  const Eigen::Matrix3d R = nearest_rotation(rotations);
  // Half of what either direction asks for.
  return pose_of(R, 0.5 * (source_images / weights - R * vector(source_)) +
                        0.5 * (vector(reference_) - R * reference_images / weights));
}

double Ensemble::translation_spread(const Pose& mean) const {
  const Pose back = mean.inverse();
  double sum = 0;
  for (const auto& [pose, gap] : members_)
    sum += squared_distance(pose.apply(source_), mean.apply(source_)) +
           squared_distance(pose.inverse().apply(reference_), back.apply(reference_));
  return radius_ > 0 ? std::sqrt(sum / (2 * static_cast<double>(members_.size()))) / radius_ : 0;
}

}  // namespace bitr::confidence
