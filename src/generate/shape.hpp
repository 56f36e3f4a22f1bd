// Closed surfaces that points can be drawn from, and what it takes to break them.
#pragma once

#include <Eigen/Core>
#include <bitr/cloud.hpp>
#include <bitr/generate.hpp>
#include <cstddef>
#include <memory>
#include <vector>

#include "core/random.hpp"

namespace bitr::generate {

struct SurfacePoint {
  Eigen::Vector3d position, normal;  ///< the normal points outwards, unit length
};

/// A solid inside the ball of solid_radius around the origin.
///
/// Its surface is drawn from by trials: one trial gives any number of points, and every piece of surface of
/// area dA expects dA / weight() of them. So trials of several surfaces, mixed in proportion to their
/// weights, are uniform over all of them together.
class Shape {
 public:
  virtual ~Shape() = default;
  virtual bool inside(const Eigen::Vector3d& at) const = 0;
  virtual double weight() const = 0;
  virtual void trial(Random& random, std::vector<SurfacePoint>& points) const = 0;
  virtual Symmetry symmetry() const { return {}; }
};

/// Adds a point to a cloud with normals unless it has `most` already.
void append(PointCloud& cloud, const SurfacePoint& point, std::size_t most);

/// `count` points, uniform by area, with outward unit normals.
PointCloud sample(const Shape& shape, std::size_t count, Random& random);

}  // namespace bitr::generate
