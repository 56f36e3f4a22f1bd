// From many hypotheses to few distinct poses that fit.
#pragma once

#include <bitr/pose.hpp>
#include <vector>

#include "core/thread_pool.hpp"
#include "solve/level.hpp"

namespace bitr::solving {

/// In resolutions: poses that move the source less than this against each other are one.
inline constexpr double distinct = 3;

/// Root of the mean squared distance between where two poses take the level's points, by their scatter.
class Motion {
 public:
  explicit Motion(const Level& level);
  double between(const Pose& a, const Pose& b) const;
  double radius() const { return std::sqrt(scatter_.trace()); }

 private:
  Eigen::Vector3d mean_;
  Eigen::Matrix3d scatter_;
};

struct IcpOptions {
  double catches = 3, ends = 1.5;  ///< resolutions: how far apart counterparts are, at first and in the end
  int iterations = 20;
  std::size_t points = 1000;  ///< of both clouds together that look for a counterpart
};
/// Point to plane, looking from both clouds, every counterpart by Tukey's biweight and the angle of its normals
/// up to sign; of solids, only those that face each other.
Pose icp(const Level& source, const Level& reference, const Pose& start, const IcpOptions& options);

}  // namespace bitr::solving
