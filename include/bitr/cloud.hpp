// Point clouds: an owning container, and a view over memory that stays the caller's.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace bitr {

using Vec3d = std::array<double, 3>;
using Vec3f = std::array<float, 3>;

/// A cloud that owns its points. Positions are in the input's units and frame, in double precision so that
/// large (for example geo-referenced) coordinates keep their digits.
struct PointCloud {
  std::vector<Vec3d> positions;  ///< N × (x, y, z)
  std::vector<Vec3f> normals;    ///< empty, or N unit vectors
  std::vector<Vec3f> colors;     ///< empty, or N × (r, g, b) in [0, 1]

  std::size_t size() const { return positions.size(); }
};

/// A triangle mesh. Faces index `vertices`; polygons are already split into triangles.
struct Mesh {
  std::vector<Vec3d> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

enum class Scalar : std::uint8_t { f32, f64 };

/// `count` rows of three numbers somewhere in the caller's memory, `stride` bytes apart.
struct Vec3View {
  const void* data = nullptr;
  std::size_t count = 0;
  std::size_t stride = 0;  ///< bytes from one row to the next, ≥ 3 numbers
  Scalar scalar = Scalar::f32;

  Vec3View() = default;
  Vec3View(const void* rows, std::size_t n, std::size_t stride_bytes, Scalar type)
      : data(rows), count(n), stride(stride_bytes), scalar(type) {}
  Vec3View(std::span<const Vec3f> rows) : Vec3View(rows.data(), rows.size(), sizeof(Vec3f), Scalar::f32) {}
  Vec3View(std::span<const Vec3d> rows) : Vec3View(rows.data(), rows.size(), sizeof(Vec3d), Scalar::f64) {}
  Vec3View(const std::vector<Vec3f>& rows) : Vec3View(std::span<const Vec3f>(rows)) {}
  Vec3View(const std::vector<Vec3d>& rows) : Vec3View(std::span<const Vec3d>(rows)) {}

  bool empty() const { return count == 0; }
  Vec3d operator[](std::size_t row) const;
};

/// One cloud as the network sees it. Nothing is copied until a plan packs its batch.
struct CloudView {
  Vec3View positions;
  Vec3View normals;  ///< empty, or one unit vector per point
  Vec3View colors;   ///< empty, or one (r, g, b) in [0, 1] per point

  CloudView() = default;
  explicit CloudView(Vec3View points) : positions(points) {}
  CloudView(const PointCloud& cloud)
      : positions(cloud.positions), normals(cloud.normals), colors(cloud.colors) {}
};

}  // namespace bitr
