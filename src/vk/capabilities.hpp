// What a physical device can do, what is wrong with it, and which kernels' variants that means.
#pragma once

#include <bitr/device.hpp>
#include <cstdint>
#include <limits>
#include <optional>
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
  float timestamp_period = 1;       ///< nanoseconds a tick
  std::uint32_t subgroup_size = 1;  ///< as the driver reports it; a kernel's subgroups may have another
  std::uint32_t least_subgroup = 1, most_subgroup = 1;  ///< what those of a kernel may have
  std::uint32_t required_subgroup = 0;  ///< what pipelines with subgroup operations ask for; 0: nothing
  bool size_control = false;            ///< subgroupSizeControl can be enabled, or the host did
  bool full_subgroups = false;          ///< so can computeFullSubgroups
  bool shares = false;  ///< can execute Tier::shuffle: subgroups of 8 to 32 that exchange what they load
  bool texel_arrays = false;  ///< and Tier::texels: any storage buffer of vec4s fits into a texel buffer
  // The tier in use, see choose().
  bool shuffle = false;
  bool texels = false;
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

  Tier tier() const { return texels ? Tier::texels : shuffle ? Tier::shuffle : Tier::basic; }
  bool executes(Tier tier) const;
  /// The best for the device unless `wanted`. Throws Failure (`unsupported`) where it cannot execute that.
  void choose(std::optional<Tier> wanted);
};

/// What a device can do, in the best tier. `size_control`: features of VK_EXT_subgroup_size_control that it has
/// are or will be enabled.
Capabilities capabilities_of(const InstanceFunctions& vk, VkPhysicalDevice device, bool size_control = true);

}  // namespace bitr::vk
