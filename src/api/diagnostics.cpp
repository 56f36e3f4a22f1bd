// What a pose looks like from outside the network: how much of the source lies on the reference.
#include <algorithm>
#include <cmath>
#include <limits>

#include "api/plan.hpp"
#include "core/point_tree.hpp"
#include "core/spacing.hpp"

namespace bitr {
namespace {

// Inliers are closer than this many median neighbour distances.
constexpr double spacing_factor = 2;

}  // namespace

double diagonal(const Vec3View& points) {
  Vec3d low = points[0], high = points[0];
  for (std::size_t i = 1; i < points.count; ++i) {
    const Vec3d p = points[i];
    for (int a = 0; a < 3; ++a) {
      low[a] = std::min(low[a], p[a]);
      high[a] = std::max(high[a], p[a]);
    }
  }
  return std::hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
}

void measure_overlap(const CloudPair& pair, const Pose& T_reference_source, ThreadPool& pool,
                     Diagnostics& diagnostics) {
  const std::vector<Vec3d> source = points_of(pair.source.positions),
                           reference = points_of(pair.reference.positions);
  const PointRows source_rows{source}, reference_rows{reference};
  const PointTree source_tree(3, source_rows, {10}), reference_tree(3, reference_rows, {10});
  const double threshold = spacing_factor * std::max(median_spacing(source_tree, source),
                                                     median_spacing(reference_tree, reference));

  // Per point, then summed in order: the same for any number of threads.
  std::vector<double> squared(source.size());
  pool.parallel_for(source.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3d moved = T_reference_source.apply(source[i]);
      std::uint32_t index = 0;
      reference_tree.knnSearch(moved.data(), 1, &index, &squared[i]);
    }
  });
  std::size_t inliers = 0;
  double sum = 0;
  for (double s : squared)
    if (s <= threshold * threshold) {
      ++inliers;
      sum += s;
    }
  diagnostics.inlier_threshold = threshold;
  diagnostics.overlap = static_cast<double>(inliers) / static_cast<double>(source.size());
  if (inliers > 0) diagnostics.inlier_rmse = std::sqrt(sum / static_cast<double>(inliers));
}

}  // namespace bitr
