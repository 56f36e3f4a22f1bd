#include <algorithm>
#include <cmath>
#include <vector>

#include "generate/field.hpp"
#include "generate/kinds.hpp"
#include "generate/relief.hpp"
#include "generate/solid.hpp"

namespace bitr::generate {
namespace {

using Eigen::Vector3d;

/// A Field whose zero level is a break through space.
class Break {
 public:
  Break(double roughness, Random& random)
      : relief_(roughness, random), slope_(std::hypot(1, relief_.steepest(solid_radius))) {
    const auto rotation = random.rotation();
    axes_ = Eigen::Map<const Eigen::Matrix3d>(rotation.data());
  }

  double operator()(const Vector3d& at) const {
    const Vector3d local = axes_ * at;
    return (local.z() - relief_.height(local.head<2>())) / slope_ - offset_;
  }

  /// Moves the break so that `share` of the points are on its negative side.
  void divide(const PointCloud& cloud, double share) {
    std::vector<double> values;
    for (const Vec3d& point : cloud.positions) values.push_back((*this)(Vector3d(point.data())));
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size()));
    std::nth_element(values.begin(), at, values.end());
    offset_ += *at;
  }

 private:
  Relief relief_;
  double slope_;  ///< dividing by it makes the height difference a bound on the distance
  Eigen::Matrix3d axes_;
  double offset_ = 0;
};

}  // namespace

Assembled fragments(const GenerateOptions& options, Random& random) {
  const Solid solid = random_solid(random);
  Break crack(options.roughness, random);
  crack.divide(sample_surface(solid, solid_radius, 1000, random), random.uniform(0.4, 0.6));
  // Outside the solid its own distance is bound enough, and the break, the costlier of the two, is not asked.
  const auto side = [&](double sign) {
    return [&solid, &crack, sign](const Vector3d& at) {
      const double distance = solid(at);
      return distance > 0 ? distance : std::max(distance, sign * crack(at));
    };
  };
  Assembled pair;
  pair.source = sample_surface(side(1), solid_radius, options.points, random);
  pair.reference = sample_surface(side(-1), solid_radius, options.points, random);
  return pair;
}

}  // namespace bitr::generate
