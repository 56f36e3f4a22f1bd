// What a physical device can do, what is wrong with it, and which kernels' variants that means.
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "vk/functions.hpp"

namespace bitr::vk {

/// A driver that does not do what Vulkan promises.
struct Quirk {
  VkDriverId driver;
  const char* reason;
  std::uint32_t loop_limit = 0;  ///< iterations after which it stops an invocation; 0: none
};

struct Capabilities {
  std::string name, driver;
  VkPhysicalDeviceType type = VK_PHYSICAL_DEVICE_TYPE_OTHER;
  VkDriverId driver_id = VkDriverId(0);
  std::uint32_t api_version = 0;
  std::uint32_t queue_family = 0;
  std::uint32_t timestamp_bits = 0;
  float timestamp_period = 1;  ///< nanoseconds a tick
  std::uint32_t subgroup_size = 1;
  bool shuffle = false;  ///< tier: neighbour searches share candidates by subgroup shuffle; else every
                         ///< invocation loads them
  bool texels = false;   ///< storage buffers of vec4s are read as texel buffers: loads of single numbers are
                         ///< slow, one by one
  std::uint32_t storage_buffers = 0;
  std::uint64_t storage_range = 0;
  std::uint64_t uniform_range = 0;
  std::uint64_t offset_alignment = 256;  ///< what the device asks of a binding's offset
  std::uint64_t alignment = 256;         ///< what the library gives every binding's offset
  std::uint32_t groups = 65535;          ///< work groups along x
  std::uint32_t invocations = 128;
  std::uint32_t shared_bytes = 16384;
  std::uint64_t memory_bytes = 0;  ///< the largest device-local heap
  std::uint32_t loop_limit = std::numeric_limits<std::uint32_t>::max();
  std::vector<const Quirk*> quirks;

  std::string unsuitable;  ///< why this device cannot run the kernels; empty when it can

  /// "shuffle" or "basic".
  const char* tier() const { return shuffle ? "shuffle" : "basic"; }
};

Capabilities capabilities_of(const InstanceFunctions& vk, VkPhysicalDevice device);

}  // namespace bitr::vk
