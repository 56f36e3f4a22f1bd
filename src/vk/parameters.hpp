// The shaders' push constants.
#pragma once

#include <cstdint>

namespace bitr::vk {

using uint = std::uint32_t;
#include "common/parameters.glsl"

}  // namespace bitr::vk
