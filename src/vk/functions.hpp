// The Vulkan functions the library calls, in tables of its own: no global function pointers, no link to a
// loader. A host application may use another loader, another instance or another device beside ours.
#pragma once

#ifndef VK_NO_PROTOTYPES
#define VK_NO_PROTOTYPES
#endif
#include <vulkan/vulkan_core.h>

#include <memory>

namespace bitr::vk {

// clang-format off
#define BITR_VK_INSTANCE_FUNCTIONS(X)                                                                   \
  X(DestroyInstance) X(EnumeratePhysicalDevices) X(GetPhysicalDeviceProperties2)                        \
  X(GetPhysicalDeviceFeatures2) X(GetPhysicalDeviceMemoryProperties)                                    \
  X(GetPhysicalDeviceQueueFamilyProperties) X(EnumerateDeviceExtensionProperties) X(CreateDevice)       \
  X(GetDeviceProcAddr)

#define BITR_VK_DEVICE_FUNCTIONS(X)                                                                     \
  X(DestroyDevice) X(GetDeviceQueue) X(DeviceWaitIdle) X(QueueSubmit)                                   \
  X(AllocateMemory) X(FreeMemory) X(MapMemory) X(BindBufferMemory) X(CreateBuffer) X(DestroyBuffer)     \
  X(GetBufferMemoryRequirements) X(CreateShaderModule) X(DestroyShaderModule)                           \
  X(CreateDescriptorSetLayout) X(DestroyDescriptorSetLayout) X(CreatePipelineLayout)                    \
  X(DestroyPipelineLayout) X(CreatePipelineCache) X(DestroyPipelineCache) X(GetPipelineCacheData)       \
  X(CreateComputePipelines) X(DestroyPipeline) X(CreateDescriptorPool) X(DestroyDescriptorPool)         \
  X(ResetDescriptorPool) X(AllocateDescriptorSets) X(UpdateDescriptorSets) X(CreateCommandPool)         \
  X(DestroyCommandPool) X(ResetCommandPool) X(AllocateCommandBuffers) X(BeginCommandBuffer)             \
  X(EndCommandBuffer) X(CmdBindPipeline) X(CmdBindDescriptorSets) X(CmdPushConstants) X(CmdDispatch)    \
  X(CmdPipelineBarrier) X(CmdCopyBuffer) X(CmdFillBuffer) X(CreateQueryPool) X(DestroyQueryPool)        \
  X(CmdResetQueryPool) X(CmdWriteTimestamp) X(GetQueryPoolResults) X(CreateSemaphore)                   \
  X(DestroySemaphore) X(WaitSemaphores) X(CreateBufferView) X(DestroyBufferView)
// clang-format on

struct InstanceFunctions {
#define BITR_VK_MEMBER(name) PFN_vk##name name = nullptr;
  BITR_VK_INSTANCE_FUNCTIONS(BITR_VK_MEMBER)
  // From VK_EXT_debug_utils; null unless it is enabled.
  PFN_vkCreateDebugUtilsMessengerEXT CreateDebugUtilsMessengerEXT = nullptr;
  PFN_vkDestroyDebugUtilsMessengerEXT DestroyDebugUtilsMessengerEXT = nullptr;

  /// Throws Failure (`unsupported`) naming the first function that is missing.
  InstanceFunctions(PFN_vkGetInstanceProcAddr get, VkInstance instance);
};

struct DeviceFunctions {
  BITR_VK_DEVICE_FUNCTIONS(BITR_VK_MEMBER)
#undef BITR_VK_MEMBER
  DeviceFunctions() = default;
  DeviceFunctions(PFN_vkGetDeviceProcAddr get, VkDevice device);
};

/// The system's loader, opened when first needed and kept open. Throws Failure (`no_device`) when there is
/// none.
PFN_vkGetInstanceProcAddr system_loader();

}  // namespace bitr::vk
