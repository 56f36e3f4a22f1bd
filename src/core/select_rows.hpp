// Some points of a cloud.
#pragma once

#include <bitr/cloud.hpp>
#include <iterator>

namespace bitr {

/// `rows`: a range of indices. With the attributes that the cloud has for every point.
template <class Rows>
PointCloud select_rows(const CloudView& cloud, const Rows& rows) {
  PointCloud result;
  result.positions.reserve(std::size(rows));
  for (const auto row : rows) result.positions.push_back(cloud.positions[row]);
  const auto select = [&](const Vec3View& values, std::vector<Vec3f>& selected) {
    if (values.count != cloud.positions.count) return;
    selected.reserve(std::size(rows));
    for (const auto row : rows) {
      const Vec3d value = values[row];
      selected.push_back(
          {static_cast<float>(value[0]), static_cast<float>(value[1]), static_cast<float>(value[2])});
    }
  };
  select(cloud.normals, result.normals);
  select(cloud.colors, result.colors);
  return result;
}

}  // namespace bitr
