#include "data_sets/file_shape.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "core/select_rows.hpp"
#include "data_sets/choose.hpp"
#include "generate/seeds.hpp"
#include "generate/solid.hpp"

namespace bitr::data {
namespace {

using generate::Draw;
using generate::mix;

// A larger mesh is kept as many points instead, so that areas need not be added up every time.
constexpr std::size_t most_triangles = 5'000;
constexpr std::size_t pool_per_point = 16;

/// Moves the middle of the box around them to the origin and the furthest point to solid_radius; false when
/// they are all in one place.
bool normalise(std::vector<Vec3d>& points) {
  constexpr double inf = std::numeric_limits<double>::infinity();
  Vec3d low = {inf, inf, inf}, high = {-inf, -inf, -inf};
  for (const Vec3d& point : points)
    for (int axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], point[axis]);
      high[axis] = std::max(high[axis], point[axis]);
    }
  double reach = 0;
  for (Vec3d& point : points) {
    for (int axis = 0; axis < 3; ++axis) point[axis] -= low[axis] / 2 + high[axis] / 2;
    reach = std::max(reach, std::hypot(point[0], point[1], point[2]));
  }
  if (!(reach > 0 && std::isfinite(reach))) return false;
  for (Vec3d& point : points)
    for (double& x : point) x = x / reach * generate::solid_radius;
  return true;
}

/// Leaves out vertices that no triangle uses.
void compact(Mesh& mesh) {
  constexpr std::uint32_t unused = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> moved(mesh.vertices.size(), unused);
  std::vector<Vec3d> vertices;
  for (auto& triangle : mesh.triangles)
    for (std::uint32_t& vertex : triangle) {
      if (moved[vertex] == unused) {
        moved[vertex] = static_cast<std::uint32_t>(vertices.size());
        vertices.push_back(mesh.vertices[vertex]);
      }
      vertex = moved[vertex];
    }
  mesh.vertices = std::move(vertices);
}

}  // namespace

Result<FileShape> FileShape::read(const std::filesystem::path& path, const Needs& needs) {
  auto geometry = io::read_geometry(path);
  if (!geometry) return tl::unexpected(geometry.error());
  FileShape shape;
  const bool is_mesh = geometry->is_mesh();
  if (is_mesh) {
    shape.mesh_ = std::move(geometry->mesh);
    compact(shape.mesh_);
  } else {
    shape.cloud_.positions = std::move(geometry->cloud.positions);
    if (needs.normals) shape.cloud_.normals = std::move(geometry->cloud.normals);
    if (shape.cloud_.size() < needs.points)
      return fail(ErrorCode::bad_file, "has " + std::to_string(shape.cloud_.size()) + " points; " +
                                           std::to_string(needs.points) + " are asked for");
    if (needs.normals && shape.cloud_.normals.empty()) return fail(ErrorCode::bad_file, "has no normals");
  }
  if (!normalise(is_mesh ? shape.mesh_.vertices : shape.cloud_.positions))
    return fail(ErrorCode::bad_file, "all of it is in one place");
  if (!is_mesh) return shape;

  const bool large = shape.mesh_.triangles.size() > most_triangles;
  auto cloud = io::sample_mesh(shape.mesh_, large ? pool_per_point * needs.points : 1, 0);
  if (!cloud) return tl::unexpected(cloud.error());
  if (large) {
    shape.cloud_ = std::move(*cloud);
    shape.mesh_ = {};
  }
  return shape;
}

Result<GeneratedPair> FileShape::sample_twice(std::size_t count, bool same_points, std::uint64_t seed) const {
  GeneratedPair pair;
  pair.overlap = 1;
  if (cloud_.positions.empty()) {
    auto source = io::sample_mesh(mesh_, count, mix(seed, 0));
    if (!source) return tl::unexpected(source.error());
    auto reference = same_points ? source : io::sample_mesh(mesh_, count, mix(seed, 1));
    if (!reference) return tl::unexpected(reference.error());
    pair.source = std::move(*source);
    pair.reference = std::move(*reference);
    return pair;
  }
  Random random = generate::random_for(seed, Draw::points);
  const bool enough = cloud_.size() / 2 >= count;
  std::vector<std::uint32_t> order =
      choose(cloud_.size(), enough && !same_points ? 2 * count : count, random);
  pair.source = select_rows(cloud_, std::span(order).first(count));
  if (same_points) {
    pair.reference = pair.source;
  } else {
    if (!enough) order = choose(cloud_.size(), count, random);
    pair.reference = select_rows(cloud_, std::span(order).subspan(enough ? count : 0, count));
  }
  return pair;
}

std::size_t FileShape::bytes() const {
  return cloud_.positions.size() * sizeof(Vec3d) + cloud_.normals.size() * sizeof(Vec3f) +
         mesh_.vertices.size() * sizeof(Vec3d) + mesh_.triangles.size() * sizeof(mesh_.triangles[0]);
}

}  // namespace bitr::data
