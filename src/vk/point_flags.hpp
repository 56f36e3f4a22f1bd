// What a one-sided layer's shaders are told of it in one number.
#pragma once

#include "ops/point_attention.hpp"
#include "vk/parameters.hpp"

namespace bitr::vk {

#include "common/point_flags.glsl"

inline std::uint32_t point_flags(const ops::PointAttention& op) {
  return (op.uniform ? POINT_UNIFORM : 0) | (op.direction ? POINT_DIRECTION : 0) |
         (op.per_cloud ? POINT_PER_CLOUD : 0) | (op.relu ? POINT_RELU : 0) |
         (op.M1.size() > 0 ? POINT_VECTOR_KEYS : 0) | (op.relu_square ? POINT_RELU_SQUARE : 0);
}

}  // namespace bitr::vk
