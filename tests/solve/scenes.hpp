// Pairs of clouds with a known answer, and simple surfaces.
#pragma once

#include <bitr/assemble.hpp>
#include <bitr/cloud.hpp>
#include <bitr/device.hpp>
#include <bitr/pose.hpp>
#include <bitr/solve.hpp>
#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include "core/random.hpp"
#include "support/random_motion.hpp"

namespace bitr::test {

inline PointCloud moved(PointCloud cloud, const Pose& T) {
  for (Vec3d& p : cloud.positions) p = T.apply(p);
  for (Vec3f& n : cloud.normals) {
    const Vec3d turned = T.rotate({n[0], n[1], n[2]});
    for (int a = 0; a < 3; ++a) n[a] = static_cast<float>(turned[a]);
  }
  return cloud;
}

inline PointCloud scaled(PointCloud cloud, double factor) {
  for (Vec3d& p : cloud.positions)
    for (double& x : p) x *= factor;
  return cloud;
}

inline PointCloud flipped(PointCloud cloud) {
  for (Vec3f& n : cloud.normals)
    for (float& c : n) c = -c;
  return cloud;
}

/// Points of a surface (x, y) → z over [-1, 1]², evenly at random, those that `keep` keeps. No normals.
inline PointCloud sheet(Random& random, std::size_t count,
                        const std::function<double(double, double)>& height,
                        const std::function<bool(double, double)>& keep, double noise = 0) {
  PointCloud cloud;
  while (cloud.positions.size() < count) {
    const double x = random.uniform(-1, 1), y = random.uniform(-1, 1);
    if (!keep(x, y)) continue;
    cloud.positions.push_back({x, y, height(x, y) + noise * random.normal()});
  }
  return cloud;
}

/// Hills that no turn or shift repeats.
inline double hills(double x, double y) {
  return 0.25 * std::sin(4 * x + 1) * std::cos(3 * y) +
         0.2 * std::exp(-12 * ((x - 0.2) * (x - 0.2) + y * y)) + 0.15 * std::sin(7 * y + 2 * x);
}

inline PointCloud sphere(Random& random, std::size_t count, double radius = 1) {
  PointCloud cloud;
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d d = radius * random_unit(random);
    cloud.positions.push_back({d[0], d[1], d[2]});
  }
  return cloud;
}

/// The closed skin of a block over [-1, 1]² from `low` up to `high`, about evenly sampled.
inline PointCloud block(Random& random, std::size_t count, const std::function<double(double, double)>& low,
                        const std::function<double(double, double)>& high) {
  PointCloud cloud;
  while (cloud.positions.size() < count) {
    const double x = random.uniform(-1, 1), y = random.uniform(-1, 1), side = random.uniform(0, 4);
    if (side < 1) {
      cloud.positions.push_back({x, y, low(x, y)});
    } else if (side < 2) {
      cloud.positions.push_back({x, y, high(x, y)});
    } else {
      const double edge = y < 0 ? -1 : 1, px = side < 3 ? edge : x, py = side < 3 ? x : edge;
      cloud.positions.push_back({px, py, random.uniform(low(px, py), high(px, py))});
    }
  }
  return cloud;
}

struct Scene {
  PointCloud source, reference;
  Pose truth;  ///< T_reference_source
  CloudPair pair() const { return {source, reference}; }
};

/// Two parts of the hills, sampled each for itself, that share about half of either, each in a frame of its own.
inline Scene overlapping_hills(std::uint64_t seed, std::size_t count = 4000, double noise = 0.002) {
  Random random(seed);
  const PointCloud left = sheet(
      random, count, hills, [](double x, double) { return x < 0.35; }, noise);
  const PointCloud right = sheet(
      random, count, hills, [](double x, double) { return x > -0.35; }, noise);
  const Pose a = random_pose(random, 3), b = random_pose(random, 3);
  return {moved(left, a), moved(right, b), b * a.inverse()};
}

inline Solution solved(const CloudPair& pair, unsigned threads = 2, const SolveOptions& options = {}) {
  auto solutions = solve(cpu_device(threads), {&pair, 1}, options);
  if (!solutions) throw std::runtime_error(solutions.error().message);
  return std::move(solutions->front());
}
inline Solution solved(const PointCloud& source, const PointCloud& reference) {
  return solved(CloudPair{source, reference});
}

/// Where two poses take a cloud's points: the largest distance between them.
inline double farthest_apart(const Pose& a, const Pose& b, const PointCloud& cloud) {
  double most = 0;
  for (const Vec3d& p : cloud.positions) {
    const Vec3d x = a.apply(p), y = b.apply(p);
    most = std::max(most, std::hypot(x[0] - y[0], x[1] - y[1], x[2] - y[2]));
  }
  return most;
}

}  // namespace bitr::test
