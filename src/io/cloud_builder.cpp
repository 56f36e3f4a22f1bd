#include "io/cloud_builder.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "io/mover.hpp"

namespace bitr::io {

int role_of(std::string_view column) {
  static constexpr struct {
    std::string_view name;
    int role;
  } names[] = {{"x", 0},           {"y", 1},        {"z", 2},        {"nx", 3},          {"ny", 4},
               {"nz", 5},          {"normal_x", 3}, {"normal_y", 4}, {"normal_z", 5},    {"normalx", 3},
               {"normaly", 4},     {"normalz", 5},  {"red", 6},      {"green", 7},       {"blue", 8},
               {"r", 6},           {"g", 7},        {"b", 8},        {"diffuse_red", 6}, {"diffuse_green", 7},
               {"diffuse_blue", 8}};
  const auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; };
  for (const auto& [name, role] : names) {
    if (std::equal(name.begin(), name.end(), column.begin(), column.end(),
                   [&](char a, char b) { return a == lower(b); })) {
      return role;
    }
  }
  return no_role;
}

bool Roles::add(int role) { return role == no_role || !std::exchange(has_[role], true); }

CloudBuilder::CloudBuilder(const File& file, bool normals, bool colors, NormalColumns columns)
    : file_(file), normals_(normals), colors_(colors), columns_(columns) {}

void CloudBuilder::reserve(std::size_t count) {
  cloud_.positions.reserve(count);
  if (normals_) cloud_.normals.reserve(count);
  if (colors_) cloud_.colors.reserve(count);
}

Result<void> CloudBuilder::add(const Row& row, Place place) {
  if (!std::isfinite(row[0]) || !std::isfinite(row[1]) || !std::isfinite(row[2])) return add_hole(row, place);
  if (normals_) {
    if (auto added = add_normal(row, place); !added) return added;
  }
  if (colors_) {
    Vec3f color;
    for (int i = 0; i < 3; ++i) {
      const double value = row[role_red + i];
      if (!(std::abs(value) <= std::numeric_limits<float>::max())) {
        return bad(file_, place, "point ", this->row(), ": a colour is ", value, "; colours must be finite");
      }
      color[i] = static_cast<float>(value);
      largest_color_ = std::max(largest_color_, color[i]);
    }
    cloud_.colors.push_back(color);
  }
  cloud_.positions.push_back({row[0], row[1], row[2]});
  return file_.mover ? file_.mover->end_row(file_, place) : Result<void>();
}

Result<void> CloudBuilder::add_hole(const Row& row, Place place) {
  if (holes_ == 0) {
    int i = 0;
    while (std::isfinite(row[i])) ++i;
    first_hole_ = text("point ", this->row(), ": ", std::string_view("xyz").substr(i, 1), " is ", row[i],
                       "; coordinates must be finite");
    first_hole_place_ = place;
  }
  if (file_.strict) return bad(file_, place, first_hole_);
  ++holes_;
  if (file_.mover) file_.mover->leave_row();
  return {};
}

void CloudBuilder::add_bare(Place place) {
  if (bare_++ == 0) {
    first_bare_ = row();
    first_bare_place_ = place;
  }
  cloud_.normals.push_back({0, 0, 0});
}

Result<void> CloudBuilder::add_normal(const Row& row, Place place) {
  const double nx = row[role_nx], ny = row[role_nx + 1], nz = row[role_nx + 2];
  const double largest = std::max({std::abs(nx), std::abs(ny), std::abs(nz)});
  const bool finite = std::isfinite(nx) && std::isfinite(ny) && std::isfinite(nz);
  if (!finite && !file_.bare_points) {
    return bad(file_, place, "point ", this->row(), ": the normal is (", nx, ", ", ny, ", ", nz,
               "); it must be finite");
  }
  if (!finite || largest == 0) return add_bare(place), Result<void>();
  nonzero_normal_ = true;
  // Scaled before squaring, so that neither tiny nor huge normals lose their direction.
  const double x = nx / largest, y = ny / largest, z = nz / largest;
  const double scaled = std::sqrt(x * x + y * y + z * z), length = scaled * largest;
  if (columns_ == NormalColumns::assumed && !(std::abs(length - 1) <= 0.1)) {
    return bad(file_, place, "point ", this->row(), ": columns 4 to 6 have length ", length,
               ", so they are not unit normals; a header line such as x,y,z,r,g,b says what they are");
  }
  // A normal that is unit to a float's precision keeps its bits: what was written is what is read.
  const bool unit = std::abs(length * length - 1) < 5e-7;
  const Vec3d n = unit ? Vec3d{nx, ny, nz} : Vec3d{x / scaled, y / scaled, z / scaled};
  cloud_.normals.push_back({static_cast<float>(n[0]), static_cast<float>(n[1]), static_cast<float>(n[2])});
  return {};
}

Result<Geometry> CloudBuilder::finish(std::vector<std::array<std::uint32_t, 3>> triangles) {
  if (holes_ > 0 && !triangles.empty()) return bad(file_, first_hole_place_, first_hole_);
  if (cloud_.positions.empty()) {
    if (holes_ == 0) return refuse(ErrorCode::bad_file, file_, "no points");
    return refuse(ErrorCode::bad_file, file_, "none of ", holes_, " points is finite");
  }
  if (!nonzero_normal_) {
    cloud_.normals.clear();
    bare_ = 0;
  }
  if (bare_ > 0 && !file_.bare_points) {
    return bad(file_, first_bare_place_, "point ", first_bare_,
               ": the normal is zero; a file gives every point a normal or none");
  }
  // Floating-point colours are in [0, 1] or in [0, 255]; the largest tells which.
  const float scale = largest_color_ > 1 ? 1.0f / 255 : 1.0f;
  for (Vec3f& color : cloud_.colors) {
    for (float& channel : color) channel = std::clamp(channel * scale, 0.0f, 1.0f);
  }
  Geometry geometry;
  geometry.holes = holes_;
  geometry.bare = bare_;
  geometry.cloud = std::move(cloud_);
  if (!triangles.empty()) geometry.mesh = {geometry.cloud.positions, std::move(triangles)};
  return geometry;
}

}  // namespace bitr::io
