// Memory by the byte.
#pragma once

#include "core/aligned.hpp"
#include "vk/device.hpp"

namespace bitr::vk {

/// Parts of scratch memory begin at multiples of this: no device may ask for more of a storage buffer's offset.
constexpr std::size_t scratch_alignment = 256;
inline std::size_t scratch_aligned(std::size_t bytes) { return aligned(bytes, scratch_alignment); }

/// Makes the buffer anew, and empty, where it is smaller than that.
inline void grow(const Context& context, Buffer& buffer, std::size_t bytes, bool host_visible) {
  if (bytes <= buffer.size()) return;
  buffer = {};  // before the next one takes memory
  buffer = Buffer(context, bytes, host_visible);
}

}  // namespace bitr::vk
