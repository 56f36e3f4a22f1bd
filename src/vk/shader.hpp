// A compiled shader and what it expects. Its header STEM.spv.hpp, which declares shaders::STEM, is made from its SPIR-V
// (cmake/reflect).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace bitr::vk {

enum class Access : std::uint8_t {
  read,      ///< storage buffer, `readonly`
  write,     ///< storage buffer, `writeonly`
  modify,    ///< storage buffer, neither
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

/// The push constants of a shader that has none.
struct NoParameters {};
template <class Parameters>
constexpr std::uint32_t push_bytes_of = sizeof(Parameters);
template <>
inline constexpr std::uint32_t push_bytes_of<NoParameters> = 0;

/// A shader with these push constants and so many specialization constants.
template <class Parameters, std::size_t Specializations>
struct ShaderOf : Shader {
  static_assert(push_bytes_of<Parameters> <= 128, "every device has 128 bytes of push constants");
  constexpr ShaderOf(const char* its_name, std::span<const std::uint32_t> words,
                     std::span<const Access> buffers)
      : Shader{its_name, words, buffers, push_bytes_of<Parameters>, Specializations} {}
};

}  // namespace bitr::vk
