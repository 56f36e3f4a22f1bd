// Breaking a shape in two.
#pragma once

#include <Eigen/Core>

#include "core/random.hpp"
#include "generate/relief.hpp"
#include "generate/shape.hpp"

namespace bitr::generate {

/// A rough, curved surface through the ball of solid_radius. Its sides are where the value, the height above
/// it, is below and above 0.
class Break {
 public:
  /// `roughness`: standard deviation of the relief.
  Break(double roughness, Random& random);
  double operator()(const Eigen::Vector3d& at) const;

  /// Moves the surface so that `share` of the points are below it.
  void divide(const PointCloud& cloud, double share);

  /// As of a Shape; the points are spread over the break within the ball, uniform by area but for the few
  /// places that are steeper than most, and the normals point to where the value is above 0. A trial gives
  /// one point at most, and only if it is inside `whole`.
  double weight() const;
  void trial(const Shape& whole, Random& random, std::vector<SurfacePoint>& points) const;

 private:
  Relief relief_;
  double most_area_;  ///< over a unit of area of the plane below, nearly everywhere
  Eigen::Matrix3d axes_;
  double offset_ = 0;
};

/// What is left of a shape below a break and above it: `count` points of each, uniform by area over the
/// fragment's whole surface, the break included, with outward unit normals.
struct Fragments {
  PointCloud below, above;
};
Fragments sample_fragments(const Shape& whole, const Break& crack, std::size_t count, Random& random);

}  // namespace bitr::generate
