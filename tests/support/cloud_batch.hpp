// Ragged batches of random clouds for kernels and executors.
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "cpu/executor.hpp"
#include "support/shapes.hpp"

namespace bitr::test {

/// Sources, then references.
struct CloudBatch {
  std::vector<PointCloud> clouds;

  CloudBatch(Random& random, const std::vector<std::array<std::size_t, 2>>& pairs) {
    for (int side = 0; side < 2; ++side)
      for (const auto& sizes : pairs) clouds.push_back(random_cloud(random, sizes[side]));
  }
  /// Every `step`-th point moves onto the one before it: edges of length zero.
  void add_duplicates(std::size_t step) {
    for (PointCloud& cloud : clouds)
      for (std::size_t i = step; i < cloud.size(); i += step) cloud.positions[i] = cloud.positions[i - 1];
  }
  void scale(double factor) {
    for (PointCloud& cloud : clouds)
      for (Vec3d& p : cloud.positions)
        for (double& x : p) x *= factor;
  }
  graph::BatchLayout layout(int key_points) const {
    std::vector<std::uint32_t> sizes;
    for (const PointCloud& cloud : clouds) sizes.push_back(static_cast<std::uint32_t>(cloud.size()));
    return {sizes, static_cast<std::uint32_t>(key_points)};
  }
  /// From the centroid, over the root mean square of their lengths.
  static std::vector<Vec3d> offsets(const PointCloud& cloud) {
    const double share = 1.0 / static_cast<double>(cloud.size());
    Vec3d centroid{};
    for (const Vec3d& p : cloud.positions)
      for (int a = 0; a < 3; ++a) centroid[a] += share * p[a];
    std::vector<Vec3d> result = cloud.positions;
    double square = 0;
    for (Vec3d& o : result)
      for (int a = 0; a < 3; ++a) {
        o[a] -= centroid[a];
        square += share * o[a] * o[a];
      }
    for (Vec3d& o : result)
      for (double& x : o) x /= std::sqrt(square);
    return result;
  }
  template <class T>
  void run(cpu::Executor<T>& executor, int key_points, ThreadPool& pool) const {
    executor.prepare(layout(key_points));
    fill(executor);
    executor.run(pool);
  }
  /// The inputs of a prepared executor.
  template <class T>
  void fill(cpu::Executor<T>& executor) const {
    for (const auto& [role, id] : executor.graph().inputs) {
      T* to = executor.data(id);
      for (const Vec3d& row : rows(role))
        for (const double x : row) *to++ = static_cast<T>(x);
    }
  }
  /// An input's rows: one per point, none where clouds do not have that input.
  std::vector<Vec3d> rows(graph::Input role) const {
    std::vector<Vec3d> all;
    const auto add = [&](const auto& rows) {
      for (const auto& [x, y, z] : rows) all.push_back({x, y, z});
    };
    for (const PointCloud& cloud : clouds) switch (role) {
        case graph::Input::positions:
          add(cloud.positions);
          break;
        case graph::Input::normals:
          add(cloud.normals);
          break;
        case graph::Input::colors:
          add(cloud.colors);
          break;
        case graph::Input::offsets:
          add(offsets(cloud));
          break;
        case graph::Input::truth:
          break;
      }
    return all;
  }
};

}  // namespace bitr::test
