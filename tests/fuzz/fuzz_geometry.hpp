// What every cloud and mesh parser promises for any bytes: an error that is one line and names the file, or a
// geometry that keeps io.hpp's promises.
#pragma once

#include <bitr/io.hpp>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>

namespace bitr::io {

inline void require(bool promise) {
  if (!promise) std::abort();
}

inline bool finite(const auto& triple) {
  return std::isfinite(triple[0]) && std::isfinite(triple[1]) && std::isfinite(triple[2]);
}

inline void check(const Error& error) {
  require(error.message.starts_with("fuzz.dat: ") && error.message.size() < 1200);
  for (const char c : error.message) require(static_cast<unsigned char>(c) >= 0x20);
}

inline void check(const Geometry& geometry) {
  const PointCloud& cloud = geometry.cloud;
  require(cloud.size() > 0);
  require(cloud.normals.empty() || cloud.normals.size() == cloud.size());
  require(cloud.colors.empty() || cloud.colors.size() == cloud.size());
  for (const Vec3d& point : cloud.positions) require(finite(point));
  for (const Vec3f& n : cloud.normals) require(std::abs(std::hypot(n[0], n[1], n[2]) - 1) < 1e-5f);
  for (const Vec3f& color : cloud.colors) {
    for (const float channel : color) require(channel >= 0 && channel <= 1);
  }
  require(!geometry.is_mesh() || geometry.mesh.vertices == cloud.positions);
  for (const auto& triangle : geometry.mesh.triangles) {
    for (const std::uint32_t vertex : triangle) require(vertex < cloud.size());
  }
  if (!geometry.is_mesh()) return;
  if (const auto sampled = sample_mesh(geometry.mesh, 8, 1)) {
    require(sampled->size() == 8);
    for (const Vec3d& point : sampled->positions) require(finite(point));
    for (const Vec3f& n : sampled->normals) require(std::abs(std::hypot(n[0], n[1], n[2]) - 1) < 1e-5f);
  }
}

inline Result<Geometry> fuzz_geometry(const std::uint8_t* data, std::size_t size, CloudFormat format) {
  auto geometry = parse_geometry({reinterpret_cast<const std::byte*>(data), size}, format, "fuzz.dat");
  if (geometry) {
    check(*geometry);
  } else {
    const ErrorCode code = geometry.error().code;
    require(code == ErrorCode::bad_file || code == ErrorCode::unsupported);
    check(geometry.error());
  }
  const Pose T = {{0.36, 0.48, -0.8, -0.8, 0.6, 0, 0.48, 0.64, 0.6}, {1, -2, 3}};
  const auto moved = moved_geometry({reinterpret_cast<const std::byte*>(data), size}, format, "fuzz.dat", T);
  // A file may move whose points have no normal here and there, as a scan's.
  const bool bare = !geometry && geometry.error().message.find(": the normal is ") != std::string::npos;
  require(geometry || bare || !moved);
  if (!moved) check(moved.error());
  return geometry;
}

}  // namespace bitr::io
