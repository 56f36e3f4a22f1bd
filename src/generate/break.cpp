#include "generate/break.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "generate/solid.hpp"

namespace bitr::generate {

using Eigen::Vector2d;
using Eigen::Vector3d;

Break::Break(double roughness, Random& random)
    : relief_(roughness, random), most_area_(std::hypot(1, relief_.steep(solid_radius))) {
  const auto rotation = random.rotation();
  axes_ = Eigen::Map<const Eigen::Matrix3d>(rotation.data());
}

double Break::operator()(const Vector3d& at) const {
  const Vector3d local = axes_ * at;
  return local.z() - relief_.height(local.head<2>()) - offset_;
}

void Break::divide(const PointCloud& cloud, double share) {
  std::vector<double> values;
  values.reserve(cloud.size());
  for (const Vec3d& point : cloud.positions) values.push_back((*this)(Vector3d(point.data())));
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size()));
  std::nth_element(values.begin(), at, values.end());
  offset_ += *at;
}

double Break::weight() const { return std::numbers::pi * solid_radius * solid_radius * most_area_; }

void Break::trial(const Shape& whole, Random& random, std::vector<SurfacePoint>& points) const {
  const double accept = random.uniform();
  Vector2d below;
  do below = {random.uniform(-solid_radius, solid_radius), random.uniform(-solid_radius, solid_radius)};
  while (below.squaredNorm() >= solid_radius * solid_radius);
  const double height = relief_.height(below) + offset_;
  const Vector3d at = axes_.transpose() * Vector3d(below.x(), below.y(), height);
  if (!whole.inside(at)) return;
  const Vector2d slope = relief_.slope(below);
  const double area = std::sqrt(1 + slope.squaredNorm());
  if (accept * most_area_ >= area) return;
  points.push_back({at, axes_.transpose() * Vector3d(-slope.x(), -slope.y(), 1) / area});
}

Fragments sample_fragments(const Shape& whole, const Break& crack, std::size_t count, Random& random) {
  Fragments fragments;
  for (PointCloud* cloud : {&fragments.below, &fragments.above}) {
    cloud->positions.reserve(count);
    cloud->normals.reserve(count);
  }
  std::vector<SurfacePoint> points;
  for (;;) {
    const bool need_below = fragments.below.size() < count, need_above = fragments.above.size() < count;
    if (!need_below && !need_above) return fragments;
    points.clear();
    // A point of the whole belongs to one fragment, a point of the break to both: while both need points,
    // each gets every other one of those, which are drawn twice as often.
    const double weight = whole.weight() + (need_below && need_above ? 2 : 1) * crack.weight();
    if (random.uniform() * weight < whole.weight()) {
      whole.trial(random, points);
      for (const SurfacePoint& point : points)
        append(crack(point.position) < 0 ? fragments.below : fragments.above, point, count);
    } else {
      const bool below = need_below && (!need_above || random.uniform() < 0.5);
      crack.trial(whole, random, points);
      for (SurfacePoint& point : points) {
        if (!below) point.normal = -point.normal;
        append(below ? fragments.below : fragments.above, point, count);
      }
    }
  }
}

}  // namespace bitr::generate
