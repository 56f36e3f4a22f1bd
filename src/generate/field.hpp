// Solids as implicit functions, and points on their surfaces.
#pragma once

#include <Eigen/Core>
#include <bitr/cloud.hpp>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "core/random.hpp"
#include "generate/shape.hpp"

namespace bitr::generate {

/// Negative inside a solid. |field(x)| never exceeds the distance from x to the solid's surface.
using Field = std::function<double(const Eigen::Vector3d&)>;

/// `count` points, uniform by area over the zero level inside the ball of `radius` around the origin, with
/// outward unit normals. Positions are within 1e-12·radius of the level along the line that found them.
///
/// Lines drawn uniformly over those that meet the ball cross every piece of surface equally often per area
/// (Cauchy–Crofton), so each crossing is a sample and no mesh or rejection is needed.
PointCloud sample_surface(const Field& field, double radius, std::size_t count, Random& random);

/// The same as a Shape: quicker per point, because a grid knows where there is nothing to be met, which takes
/// a while to make.
class FieldShape : public Shape {
 public:
  /// The zero level must lie within the ball of solid_radius.
  explicit FieldShape(Field field);
  bool inside(const Eigen::Vector3d& at) const override { return field_(at) < 0; }
  double weight() const override;
  void trial(Random& random, std::vector<SurfacePoint>& points) const override;

 private:
  void find_empty(const int first[3], int cells);
  Field field_;
  std::vector<std::uint8_t> empty_;  ///< for each of the grid's cells: how many wide the block around it is
                                     ///< through which no surface passes; 0: one may
  double radius_ = 0;                ///< radius of the ball around the cells that are not empty
};

}  // namespace bitr::generate
