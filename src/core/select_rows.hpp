// Some points of a cloud.
#pragma once

#include <bitr/cloud.hpp>
#include <span>

namespace bitr {

/// With the attributes that the cloud has for every point.
PointCloud select_rows(const CloudView& cloud, std::span<const std::size_t> rows);

}  // namespace bitr
