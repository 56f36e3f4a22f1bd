#include "solve/prepare.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/centroid.hpp"
#include "core/finite.hpp"
#include "core/spacing.hpp"

namespace bitr::solving {
namespace {

// A resolution below this many grains shows the sampling, not the surface.
constexpr double least_grains = 1;

// From the distance in which a point has so many neighbours, about the middle of its ring.
double grain_of(const PointTree& tree, const std::vector<Vec3d>& points) {
  constexpr std::size_t samples = 1000, around = 9;
  const std::size_t step = std::max<std::size_t>(1, points.size() / samples);
  std::vector<double> squared;
  for (std::size_t i = 0; i < points.size(); i += step) {
    std::uint32_t index[around];
    double distance[around];
    const std::size_t found = tree.knnSearch(points[i].data(), around, index, distance);
    squared.push_back(distance[found - 1] / static_cast<double>(found));
  }
  std::nth_element(squared.begin(), squared.begin() + static_cast<std::ptrdiff_t>(squared.size() / 2),
                   squared.end());
  return std::sqrt(std::numbers::pi * squared[squared.size() / 2]);
}

void make_ready(Level& level, Thinned cloud, double resolution) {
  level.resolution = resolution;
  level.given_normals = !cloud.normals.empty();
  level.points = std::move(cloud.points);
  level.normals = std::move(cloud.normals);
  level.tree = std::make_unique<PointTree>(3, level.rows, nanoflann::KDTreeSingleIndexAdaptorParams(10));
}

}  // namespace

Prepared prepare(const CloudView& cloud, const std::optional<Vec3d>& viewpoint) {
  Prepared result;
  const bool normals = !cloud.normals.empty();
  std::vector<Vec3d>& points = result.cloud.points;
  for (std::size_t i = 0; i < cloud.positions.count; ++i) {
    const Vec3d point = cloud.positions[i];
    if (!is_finite(point)) {
      ++result.dropped;
      continue;
    }
    points.push_back(point);
    if (!normals) continue;
    Vec3d normal = cloud.normals[i];
    if (!is_finite(normal)) normal = {};
    result.cloud.normals.push_back(normal);
  }
  if (points.empty()) return result;
  result.centroid = centroid_of(points);
  if (viewpoint) {
    result.viewpoint = *viewpoint;
    for (int a = 0; a < 3; ++a) (*result.viewpoint)[a] -= result.centroid[a];
  }
  double squares = 0;
  for (Vec3d& point : points)
    for (int a = 0; a < 3; ++a) {
      point[a] -= result.centroid[a];
      squares += point[a] * point[a];
    }
  result.radius = std::sqrt(squares / static_cast<double>(points.size()));
  const PointRows rows{points};
  const PointTree tree(3, rows, nanoflann::KDTreeSingleIndexAdaptorParams(16));
  result.spacing = median_spacing(tree, points);
  result.grain = grain_of(tree, points);
  return result;
}

Spread spread_to(const Prepared& cloud, std::size_t most, double least) {
  const auto share = [&](std::size_t n) {
    return std::sqrt(static_cast<double>(n) / static_cast<double>(most));
  };
  Spread result;
  result.apart = std::max(least, 0.8 * cloud.grain * share(cloud.cloud.points.size()));
  result.cloud = thin(cloud.cloud, result.apart);
  // The number of points falls with the square of their distance on a surface, more slowly where they lie in
  // rings; each round starts from the one before, which is finer.
  for (int round = 0; round < 8 && result.cloud.points.size() > most; ++round) {
    result.apart *= std::max(1.02, share(result.cloud.points.size()));
    result.cloud = thin(result.cloud, result.apart);
  }
  return result;
}

std::unique_ptr<LevelPair> levels(const Prepared& source, const Prepared& reference, std::size_t most,
                                  double reach, std::size_t count, ThreadPool& pool) {
  const double least = least_grains * std::max(source.grain, reference.grain);
  Spread both[2];
  pool.parallel_for(2, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) both[i] = spread_to(i == 0 ? source : reference, most, least);
  });
  const double resolution = std::max(both[0].apart, both[1].apart);
  for (Spread& spread : both)
    if (spread.apart < resolution) spread.cloud = thin(spread.cloud, resolution);
  auto pair = std::make_unique<LevelPair>();
  make_ready(pair->source, std::move(both[0].cloud), resolution);
  make_ready(pair->reference, std::move(both[1].cloud), resolution);
  pair->near_source = neighbours(pair->source, reach * resolution, count, pool);
  pair->near_reference = neighbours(pair->reference, reach * resolution, count, pool);
  estimate_normals(pair->source, pair->near_source, source.viewpoint, pool);
  estimate_normals(pair->reference, pair->near_reference, reference.viewpoint, pool);
  return pair;
}

}  // namespace bitr::solving
