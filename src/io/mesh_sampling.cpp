// Points from meshes, and fewer points from clouds; both repeat exactly for a seed.
#include <algorithm>
#include <cmath>
#include <limits>
#include <new>
#include <stdexcept>

#include "core/random.hpp"
#include "core/select_rows.hpp"
#include "io/complaint.hpp"
#include "io/formats.hpp"

namespace bitr::io {
namespace {

Vec3d minus(const Vec3d& a, const Vec3d& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

Vec3d cross(const Vec3d& a, const Vec3d& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

struct Direction {
  double length;
  Vec3d unit;
};

// Scaled before squaring: a sliver's area may be too small to square.
Direction direction(const Vec3d& a) {
  const double largest = std::max({std::abs(a[0]), std::abs(a[1]), std::abs(a[2])});
  if (!(largest > 0)) return {0, {}};
  const double x = a[0] / largest, y = a[1] / largest, z = a[2] / largest;
  const double scaled = std::sqrt(x * x + y * y + z * z);
  return {scaled * largest, {x / scaled, y / scaled, z / scaled}};
}

struct Triangle {
  Vec3d corner;
  Vec3d side_b, side_c;  ///< in units of the mesh's extent, so that no product overflows
};

double extent(const Mesh& mesh) {
  constexpr double inf = std::numeric_limits<double>::infinity();
  Vec3d low{inf, inf, inf}, high{-inf, -inf, -inf};
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t vertex : triangle) {
      for (int k = 0; k < 3; ++k) {
        low[k] = std::min(low[k], mesh.vertices[vertex][k]);
        high[k] = std::max(high[k], mesh.vertices[vertex][k]);
      }
    }
  }
  return std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
}

Triangle triangle_of(const Mesh& mesh, std::size_t index, double unit) {
  const auto& [a, b, c] = mesh.triangles[index];
  Triangle triangle{mesh.vertices[a], minus(mesh.vertices[b], mesh.vertices[a]),
                    minus(mesh.vertices[c], mesh.vertices[a])};
  for (int k = 0; k < 3; ++k) {
    triangle.side_b[k] /= unit;
    triangle.side_c[k] /= unit;
  }
  return triangle;
}

// Twice the area, along the normal. Never inlined: a triangle whose area rounds to zero must do so every
// time.
[[gnu::noinline]] Vec3d area_vector(const Triangle& triangle) {
  return cross(triangle.side_b, triangle.side_c);
}

Result<PointCloud> sample(const Mesh& mesh, std::size_t count, std::uint64_t seed) {
  if (count == 0) return fail(ErrorCode::invalid_argument, "0 points to sample; at least 1 is needed");
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    for (const std::uint32_t vertex : mesh.triangles[i]) {
      if (vertex >= mesh.vertices.size()) {
        return fail(ErrorCode::invalid_argument,
                    text("triangle ", i, " uses vertex ", vertex, "; there are ", mesh.vertices.size()));
      }
    }
  }
  const double unit = mesh.triangles.empty() ? 0 : extent(mesh);
  std::vector<double> area_up_to(mesh.triangles.size());
  double area = 0;
  for (std::size_t i = 0; i < mesh.triangles.size() && unit > 0 && std::isfinite(unit); ++i) {
    area_up_to[i] = area += direction(area_vector(triangle_of(mesh, i, unit))).length;
  }
  if (!(area > 0) || !std::isfinite(area)) {
    return fail(ErrorCode::invalid_argument,
                text("the mesh's ", mesh.triangles.size(), " triangles have no area that a double can hold"));
  }

  // Three draws for each point, whatever triangle they fall on, and none that depends on the frame: a mesh
  // that is moved rigidly gives the same points, moved.
  Random random(seed);
  PointCloud cloud;
  cloud.positions.reserve(count);
  cloud.normals.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double pick = random.uniform() * area;
    const double across = std::sqrt(random.uniform()), along = random.uniform();
    auto found = std::upper_bound(area_up_to.begin(), area_up_to.end(), pick);
    if (found == area_up_to.end()) found = std::lower_bound(area_up_to.begin(), area_up_to.end(), area);
    const Triangle triangle = triangle_of(mesh, static_cast<std::size_t>(found - area_up_to.begin()), unit);
    const double b = across * (1 - along) * unit, c = across * along * unit;
    Vec3d point;
    const Vec3d normal = direction(area_vector(triangle)).unit;
    for (int k = 0; k < 3; ++k)
      point[k] = triangle.corner[k] + b * triangle.side_b[k] + c * triangle.side_c[k];
    cloud.positions.push_back(point);
    cloud.normals.push_back(
        {static_cast<float>(normal[0]), static_cast<float>(normal[1]), static_cast<float>(normal[2])});
  }
  return cloud;
}

}  // namespace

Result<PointCloud> sample_mesh(const Mesh& mesh, std::size_t count, std::uint64_t seed) try {
  return sample(mesh, count, seed);
} catch (const std::bad_alloc&) {
  return fail(ErrorCode::invalid_argument, text(count, " points to sample are too many for memory"));
} catch (const std::length_error&) {
  return fail(ErrorCode::invalid_argument, text(count, " points to sample are too many for memory"));
}

PointCloud subsample(const CloudView& cloud, std::size_t count, std::uint64_t seed) {
  const std::size_t points = cloud.positions.count;
  count = std::min(count, points);
  std::vector<std::size_t> rows;
  rows.reserve(count);
  // Selection sampling: a point's chance is what makes every subset of `count` points equally likely.
  Random random(seed);
  for (std::size_t i = 0; rows.size() < count; ++i)
    if (random.below(points - i) < count - rows.size()) rows.push_back(i);
  return select_rows(cloud, rows);
}

}  // namespace bitr::io
