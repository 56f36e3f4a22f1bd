// Clouds for tests of the whole network: random shapes without symmetry, moved, scaled, reordered.
#pragma once

#include <algorithm>
#include <bitr/cloud.hpp>
#include <bitr/pose.hpp>
#include <cmath>
#include <numeric>
#include <vector>

#include "core/random.hpp"

namespace bitr::test {

/// `count` points of a bent, uneven blob of about unit size, with unit normals and colours.
inline PointCloud random_cloud(Random& random, std::size_t count) {
  PointCloud cloud;
  const double bend = random.uniform(0.3, 0.8), stretch = random.uniform(0.4, 0.9);
  for (std::size_t i = 0; i < count; ++i) {
    const double u = random.uniform(-1, 1), v = random.uniform(-1, 1) * (1 - 0.4 * u),
                 w = random.uniform(-1, 1);
    cloud.positions.push_back({u, stretch * v + bend * u * u, 0.4 * w + 0.3 * u * v});
    const double length = std::hypot(u, v, w);
    cloud.normals.push_back(
        {static_cast<float>(w / length), static_cast<float>(u / length), static_cast<float>(v / length)});
    cloud.colors.push_back({static_cast<float>(random.uniform()), static_cast<float>(random.uniform()),
                            static_cast<float>(random.uniform())});
  }
  return cloud;
}

/// A cloud whose normals are kept in double precision, so that turning them loses nothing.
struct ExactCloud {
  std::vector<Vec3d> positions, normals, colors;

  ExactCloud() = default;
  explicit ExactCloud(const PointCloud& cloud) : positions(cloud.positions) {
    for (const Vec3f& n : cloud.normals) normals.push_back({n[0], n[1], n[2]});
    for (const Vec3f& c : cloud.colors) colors.push_back({c[0], c[1], c[2]});
  }
  CloudView view() const {
    CloudView view{Vec3View(positions)};
    view.normals = normals;
    view.colors = colors;
    return view;
  }
  std::size_t size() const { return positions.size(); }
};

inline ExactCloud exact_cloud(Random& random, std::size_t count) {
  return ExactCloud(random_cloud(random, count));
}

inline ExactCloud moved(ExactCloud cloud, const Pose& pose) {
  for (Vec3d& p : cloud.positions) p = pose.apply(p);
  for (Vec3d& n : cloud.normals) n = pose.rotate(n);
  return cloud;
}

inline ExactCloud scaled(ExactCloud cloud, double factor) {
  for (Vec3d& p : cloud.positions)
    for (double& x : p) x *= factor;
  return cloud;
}

inline ExactCloud shuffled(const ExactCloud& cloud, Random& random) {
  std::vector<std::size_t> order(cloud.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  for (std::size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[random.below(i)]);
  ExactCloud result;
  for (std::size_t i : order) {
    result.positions.push_back(cloud.positions[i]);
    result.normals.push_back(cloud.normals[i]);
    result.colors.push_back(cloud.colors[i]);
  }
  return result;
}

/// Length of the bounding box's diagonal.
inline double size_of(const ExactCloud& cloud) {
  Vec3d low = cloud.positions.front(), high = low;
  for (const Vec3d& p : cloud.positions)
    for (int a = 0; a < 3; ++a) {
      low[a] = std::min(low[a], p[a]);
      high[a] = std::max(high[a], p[a]);
    }
  return std::hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
}

}  // namespace bitr::test
