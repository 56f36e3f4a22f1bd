// Two clouds that were drawn densely once, for samples to take points from.
#pragma once

#include <bitr/generate.hpp>
#include <cstdint>
#include <vector>

#include "core/random.hpp"

namespace bitr::data {

/// The sides of a pair that is not yet separated, with normals: two samples of a shape, or its fragments.
/// Kept in single precision.
class DensePair {
 public:
  explicit DensePair(const GeneratedPair& pair);

  /// `count` different points of each side, or the same of the source twice.
  GeneratedPair draw(std::size_t count, bool same_points, std::uint64_t seed) const;
  std::size_t bytes() const { return bytes_of(source_.size()); }
  static std::size_t bytes_of(std::size_t points) { return 2 * points * sizeof(Point); }  ///< `points` a side

 private:
  struct Point {
    Vec3f position, normal;
  };
  static std::vector<Point> points_of(const PointCloud& cloud);
  static PointCloud draw(const std::vector<Point>& points, std::size_t count, Random& random);

  std::vector<Point> source_, reference_;
  double overlap_;
  Symmetry symmetry_;
};

}  // namespace bitr::data
