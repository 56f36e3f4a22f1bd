// Inside an application that has a Vulkan device of its own: plans run on that device, and whole passes are
// recorded into its command buffers. The only header of the library that includes Vulkan's.
#pragma once

#include <vulkan/vulkan_core.h>

#include <bitr/assemble.hpp>
#include <bitr/device.hpp>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>

namespace bitr::vk {

/// What the application shares. All handles stay its own and must outlive every plan on the device.
struct AdoptInfo {
  PFN_vkGetInstanceProcAddr get_instance_proc_addr = nullptr;  ///< from the loader the instance came from
  VkInstance instance = VK_NULL_HANDLE;                        ///< made for Vulkan 1.2 or later
  VkPhysicalDevice physical_device = VK_NULL_HANDLE;
  VkDevice device = VK_NULL_HANDLE;
  VkQueue queue = VK_NULL_HANDLE;  ///< from a family with compute
  std::uint32_t queue_family = 0;
  /// The one feature that the library needs of the device; the application states that it enabled it.
  bool timeline_semaphore_enabled = false;
  /// Whether it enabled subgroupSizeControl and computeFullSubgroups, of Vulkan 1.3 or
  /// VK_EXT_subgroup_size_control. Where a driver chooses the size of every kernel's subgroups, the best tier
  /// may hang on them.
  bool subgroup_size_control_enabled = false;
  std::optional<Tier> tier = {};  ///< empty: the best for the device
  /// Called around every submission, if the application uses the queue from other threads. Both or neither.
  std::function<void()> lock_queue = {}, unlock_queue = {};
  const VkAllocationCallbacks* allocation = nullptr;
  VkPipelineCache pipeline_cache = VK_NULL_HANDLE;  ///< used, never destroyed
  unsigned threads = 0;                             ///< CPU threads for what stays on the CPU; 0: every core
};

/// A device on the application's own. `invalid_argument` names the missing handle, a family without compute
/// or a feature that is not enabled; `no_device` says why the physical device is unsuitable, `unsupported`
/// why it cannot execute the asked tier.
Result<Device> adopt(const AdoptInfo& info);

struct BufferSlice {
  VkBuffer buffer = VK_NULL_HANDLE;
  VkDeviceSize offset = 0;  ///< a multiple of minStorageBufferOffsetAlignment
};

/// Clouds that are on the device already, and where the poses go.
struct Bindings {
  BufferSlice source_positions;                 ///< f32 rows of x, y, z: all sources' points, pair after pair
  BufferSlice reference_positions;              ///< the same of the references
  std::uint32_t position_stride = 3;            ///< numbers from one point to the next, ≥ 3
  std::span<const std::uint32_t> source_sizes;  ///< points of every source
  std::span<const std::uint32_t> reference_sizes = {};  ///< points of every reference
  BufferSlice poses;  ///< f32[pairs, 16]: row-major 4×4, T_reference_source
};

/// Records a forward pass over `bindings` into the application's command buffer, which is being recorded, on
/// any queue of the adopted device with compute. No submission, no wait, no device memory is allocated.
///
/// Contract: the buffers have VK_BUFFER_USAGE_STORAGE_BUFFER_BIT and the positions are visible to compute
/// shaders by then; the poses are written by compute shaders, and the application puts its own barrier
/// between them and who reads them. Afterwards the compute bind point's pipeline, descriptor set 0 and push
/// constants are undefined. The command buffer may be submitted any number of times, one execution after the
/// other. While it may run, the plan is in use: neither assemble() nor record() may be called with it, and a
/// later record() with the same plan makes this recording invalid. Non-finite positions give a pose of NaN.
///
/// `invalid_argument` when the plan is not on a Vulkan device, a buffer is missing, the numbers of clouds
/// differ, a cloud has too few points or the capacity is exceeded; `unsupported` when the model reads normals
/// or colours.
Result<void> record(VkCommandBuffer commands, Plan& plan, const Bindings& bindings);

}  // namespace bitr::vk
