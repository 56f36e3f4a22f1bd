// Memory by the byte.
#pragma once

#include "vk/device.hpp"

namespace bitr::vk {

inline std::size_t aligned(std::size_t bytes, std::size_t alignment) {
  return (bytes + alignment - 1) / alignment * alignment;
}

/// Makes the buffer anew, and empty, where it is smaller than that.
inline void grow(const Context& context, Buffer& buffer, std::size_t bytes, bool host_visible) {
  if (bytes <= buffer.size()) return;
  buffer = {};  // before the next one takes memory
  buffer = Buffer(context, bytes, host_visible);
}

}  // namespace bitr::vk
