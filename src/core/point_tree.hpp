// A k-d tree over points in double precision.
#pragma once

#include <bitr/cloud.hpp>
#include <cstdint>
#include <nanoflann.hpp>
#include <vector>

namespace bitr {

inline std::vector<Vec3d> points_of(const Vec3View& view) {
  std::vector<Vec3d> points(view.count);
  for (std::size_t i = 0; i < points.size(); ++i) points[i] = view[i];
  return points;
}

/// nanoflann's view of points, which must outlive it.
struct PointRows {
  const std::vector<Vec3d>& points;
  std::size_t kdtree_get_point_count() const { return points.size(); }
  double kdtree_get_pt(std::size_t i, std::size_t axis) const { return points[i][axis]; }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using PointTree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, PointRows>,
                                                      PointRows, 3, std::uint32_t>;

}  // namespace bitr
