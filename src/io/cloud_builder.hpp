// The rules every format shares: which columns mean what, what a value may be, how polygons become triangles.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "io/complaint.hpp"
#include "io/formats.hpp"

namespace bitr::io {

enum Role : int { role_x, role_nx = 3, role_red = 6, role_count = 9 };
inline constexpr int no_role = -1;

/// One value per role: x y z, nx ny nz, red green blue.
using Row = std::array<double, role_count>;

/// The role of a column by its usual names, in either case ("x", "nx", "normal_x", "red", "r", …), or
/// no_role.
int role_of(std::string_view column);

/// Which roles a file's columns fill. Normals and colours count only when all three of theirs are there.
class Roles {
 public:
  /// False when the role is taken already.
  bool add(int role);
  bool positions() const { return triple(role_x); }
  bool normals() const { return triple(role_nx); }
  bool colors() const { return triple(role_red); }

 private:
  bool triple(int first) const { return has_[first] && has_[first + 1] && has_[first + 2]; }
  std::array<bool, role_count> has_{};
};

/// Whether normals come from columns whose names say so, or only from their position in the row.
enum class NormalColumns { named, assumed };

/// Collects rows into a cloud and names the row it refuses; see io.hpp for what becomes of holes and missing normals.
class CloudBuilder {
 public:
  CloudBuilder(const File& file, bool normals, bool colors, NormalColumns columns = NormalColumns::named);

  /// Expected rows. The caller has checked `count` against the bytes that are there.
  void reserve(std::size_t count);
  Result<void> add(const Row& row, Place place);
  /// The cloud alone, or with triangles the mesh over its points. `bad_file` when there was no point, or a triangle's
  /// vertex could be a hole.
  Result<Geometry> finish(std::vector<std::array<std::uint32_t, 3>> triangles = {});

 private:
  Result<void> add_normal(const Row& row, Place place);
  Result<void> add_hole(const Row& row, Place place);
  void add_bare(Place place);
  std::size_t row() const { return cloud_.size() + holes_; }

  const File& file_;
  bool normals_, colors_;
  NormalColumns columns_;
  PointCloud cloud_;
  bool nonzero_normal_ = false;
  std::size_t holes_ = 0, bare_ = 0, first_bare_ = 0;
  Place first_bare_place_;
  std::string first_hole_;  ///< what is wrong with it
  Place first_hole_place_;
  float largest_color_ = 0;
};

/// Splits polygons into triangles that share the first corner. Polygons of fewer than three corners vanish.
class FanBuilder {
 public:
  void begin() { corners_ = 0; }
  void corner(std::uint32_t vertex) {
    if (corners_ == 0) first_ = vertex;
    if (corners_ >= 2) triangles_.push_back({first_, last_, vertex});
    last_ = vertex;
    ++corners_;
  }
  std::vector<std::array<std::uint32_t, 3>> finish() { return std::move(triangles_); }

 private:
  std::vector<std::array<std::uint32_t, 3>> triangles_;
  std::uint32_t first_ = 0, last_ = 0;
  std::size_t corners_ = 0;
};

}  // namespace bitr::io
