// A compiled shader and what it expects: the other half of the header in shaders/*.comp.
#pragma once

#include <cstdint>
#include <span>

namespace bitr::vk {

enum class Access : std::uint8_t {
  read,      ///< storage buffer
  write,     ///< storage buffer
  modify,    ///< storage buffer, read and written
  constant,  ///< uniform buffer
  texels,    ///< uniform texel buffer of vec4s: read as a storage buffer is, faster on some devices
};

struct Shader {
  const char* name;
  std::span<const std::uint32_t> spirv;
  std::span<const Access> bindings;   ///< set 0, binding 0 …
  std::uint32_t push_bytes = 0;       ///< bytes of its parameters (shaders/common/parameters.glsl)
  std::uint32_t specializations = 0;  ///< constant ids 0 … n−1; id 0 is the work group's size
};

}  // namespace bitr::vk
