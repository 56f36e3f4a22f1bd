// Random solids without symmetry.
#pragma once

#include <Eigen/Core>
#include <bitr/cloud.hpp>
#include <memory>
#include <vector>

#include "core/random.hpp"
#include "generate/shape.hpp"

namespace bitr::generate {

/// The ball around the origin that holds every solid.
inline constexpr double solid_radius = 0.5;

/// The smooth union of an ellipsoid and a few smaller ellipsoids and rounded boxes around it; a Field.
class Solid {
 public:
  explicit Solid(Random& random);
  double operator()(const Eigen::Vector3d& at) const;

 private:
  struct Part {
    Eigen::Matrix3d axes;  ///< rows: the part's axes
    Eigen::Vector3d center, half_size;
    bool box;
    double distance(const Eigen::Vector3d& at) const;
    double reach() const;
  };
  std::vector<Part> parts_;
  double blend_;  ///< width of the fillets between parts
};

/// The points of a regular grid that are inside.
PointCloud interior(const Solid& solid);

/// How far the points are from having a rotational symmetry: 0 for a symmetric cloud, about 0.1 and more for
/// one whose orientation is easy to tell. No unit: it does not change with scale or pose.
double asymmetry(const PointCloud& cloud);

/// A solid with a clear asymmetry.
Solid random_solid(Random& random);
std::unique_ptr<Shape> random_solid_shape(Random& random);

}  // namespace bitr::generate
