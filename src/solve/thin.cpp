#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/centroid.hpp"
#include "solve/cells.hpp"
#include "solve/level.hpp"

namespace bitr::solving {
namespace {

double squared_distance(const Vec3d& a, const Vec3d& b) {
  double sum = 0;
  for (int i = 0; i < 3; ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return sum;
}

std::vector<std::uint32_t> from_the_middle(const std::vector<Vec3d>& points) {
  const Vec3d middle = centroid_of(points);
  std::vector<double> squared(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) squared[i] = squared_distance(points[i], middle);
  std::vector<std::uint32_t> order(points.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return squared[a] < squared[b] || (squared[a] == squared[b] && points[a] < points[b]);
  });
  return order;
}

}  // namespace

Thinned thin(const Thinned& cloud, double apart) {
  Cells cells(apart, cloud.points.size());
  std::vector<Vec3d> chosen;
  for (const std::uint32_t i : from_the_middle(cloud.points)) {
    bool room = true;
    cells.within(cloud.points[i], [&](std::uint32_t, double) { return room = false; });
    if (!room) continue;
    cells.add(cloud.points[i], static_cast<std::uint32_t>(chosen.size()));
    chosen.push_back(cloud.points[i]);
  }

  std::vector<Vec3d> sums(chosen.size(), Vec3d{}),
      normals(cloud.normals.empty() ? 0 : chosen.size(), Vec3d{});
  std::vector<double> counts(chosen.size(), 0);
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    std::uint32_t nearest = 0;
    double least = std::numeric_limits<double>::infinity();
    cells.within(cloud.points[i], [&](std::uint32_t index, double squared) {
      if (squared < least || (squared == least && index < nearest)) {
        least = squared;
        nearest = index;
      }
      return true;
    });
    ++counts[nearest];
    for (int a = 0; a < 3; ++a) sums[nearest][a] += cloud.points[i][a] - chosen[nearest][a];
    if (!normals.empty())
      for (int a = 0; a < 3; ++a) normals[nearest][a] += cloud.normals[i][a];
  }
  Thinned result{std::move(chosen), std::move(normals)};
  for (std::size_t i = 0; i < counts.size(); ++i)
    for (int a = 0; a < 3; ++a) result.points[i][a] += sums[i][a] / counts[i];
  for (Vec3d& normal : result.normals) {
    const double length = std::sqrt(squared_distance(normal, {}));
    for (double& c : normal) c = length > 0 ? c / length : 0;
  }
  return result;
}

}  // namespace bitr::solving
