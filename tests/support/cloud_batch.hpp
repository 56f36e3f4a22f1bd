// Ragged batches of random clouds for kernels and executors.
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "graph/executor.hpp"
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
  void run(graph::Executor& executor, int key_points) const {
    executor.prepare(layout(key_points));
    fill(executor);
    executor.run();
  }
  /// The inputs of a prepared executor, those that clouds have.
  void fill(graph::Executor& executor) const {
    for (const auto& [role, id] : executor.graph().inputs)
      if (const std::vector<double> numbers = rows(role); !numbers.empty()) executor.write(id, numbers);
  }
  /// An input's rows: one per point, none where clouds do not have that input.
  std::vector<double> rows(graph::Input role) const {
    std::vector<double> all;
    const auto add = [&](const auto& rows) {
      for (const auto& row : rows) all.insert(all.end(), row.begin(), row.end());
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
