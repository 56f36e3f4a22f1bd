#include "core/select_rows.hpp"

namespace bitr {
namespace {

std::vector<Vec3f> selected(const Vec3View& values, std::span<const std::size_t> rows) {
  std::vector<Vec3f> result;
  result.reserve(rows.size());
  for (const std::size_t row : rows) {
    const Vec3d value = values[row];
    result.push_back(
        {static_cast<float>(value[0]), static_cast<float>(value[1]), static_cast<float>(value[2])});
  }
  return result;
}

}  // namespace

PointCloud select_rows(const CloudView& cloud, std::span<const std::size_t> rows) {
  PointCloud result;
  result.positions.reserve(rows.size());
  for (const std::size_t row : rows) result.positions.push_back(cloud.positions[row]);
  if (cloud.normals.count == cloud.positions.count) result.normals = selected(cloud.normals, rows);
  if (cloud.colors.count == cloud.positions.count) result.colors = selected(cloud.colors, rows);
  return result;
}

}  // namespace bitr
