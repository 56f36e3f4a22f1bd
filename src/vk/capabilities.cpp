#include "vk/capabilities.hpp"

#include <algorithm>

namespace bitr::vk {
namespace {

constexpr Quirk quirks[] = {
    {.driver = VK_DRIVER_ID_MESA_LLVMPIPE,
     .reason = "stops an invocation without a word after 65,535 loop iterations, all loops together",
     .loop_limit = 65535},
};

constexpr std::uint32_t least_storage_buffers = 8, least_invocations = 128, least_shared = 16384;

std::string version_text(std::uint32_t version) {
  return std::to_string(VK_API_VERSION_MAJOR(version)) + "." + std::to_string(VK_API_VERSION_MINOR(version));
}

std::string fault(const Capabilities& c, bool compute, bool timeline) {
  const auto too_small = [](const char* what, std::uint64_t value, std::uint64_t least) {
    return std::string(what) + " is " + std::to_string(value) + ", at least " + std::to_string(least) +
           " is needed";
  };
  if (c.api_version < VK_API_VERSION_1_2) return "Vulkan " + version_text(c.api_version) + ", 1.2 is needed";
  if (!compute) return "no queue family with compute";
  if (!timeline) return "no timeline semaphores";
  if (c.storage_buffers < least_storage_buffers)
    return too_small("maxPerStageDescriptorStorageBuffers", c.storage_buffers, least_storage_buffers);
  if (c.invocations < least_invocations)
    return too_small("maxComputeWorkGroupInvocations", c.invocations, least_invocations);
  if (c.shared_bytes < least_shared)
    return too_small("maxComputeSharedMemorySize", c.shared_bytes, least_shared);
  return "";
}

}  // namespace

Capabilities capabilities_of(const InstanceFunctions& vk, VkPhysicalDevice device) {
  VkPhysicalDeviceDriverProperties driver{.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DRIVER_PROPERTIES,
                                          .pNext = nullptr,
                                          .driverID = VkDriverId(0),
                                          .driverName = {},
                                          .driverInfo = {},
                                          .conformanceVersion = {}};
  VkPhysicalDeviceSubgroupProperties subgroup{.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_PROPERTIES,
                                              .pNext = &driver,
                                              .subgroupSize = 1,
                                              .supportedStages = 0,
                                              .supportedOperations = 0,
                                              .quadOperationsInAllStages = VK_FALSE};
  VkPhysicalDeviceProperties2 properties{
      .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, .pNext = &subgroup, .properties = {}};
  vk.GetPhysicalDeviceProperties2(device, &properties);
  const VkPhysicalDeviceProperties& p = properties.properties;

  Capabilities c;
  c.name = p.deviceName;
  c.driver = std::string(driver.driverName) + " " + driver.driverInfo;
  c.driver_id = driver.driverID;
  c.type = p.deviceType;
  c.api_version = p.apiVersion;
  c.timestamp_period = p.limits.timestampPeriod;
  c.subgroup_size = subgroup.subgroupSize;
  c.storage_buffers = p.limits.maxPerStageDescriptorStorageBuffers;
  c.storage_range = p.limits.maxStorageBufferRange;
  c.uniform_range = p.limits.maxUniformBufferRange;
  c.offset_alignment = p.limits.minStorageBufferOffsetAlignment;
  c.alignment = std::max({p.limits.minStorageBufferOffsetAlignment, p.limits.minUniformBufferOffsetAlignment,
                          p.limits.minTexelBufferOffsetAlignment, VkDeviceSize{64}});
  c.groups = p.limits.maxComputeWorkGroupCount[0];
  c.invocations = std::min(p.limits.maxComputeWorkGroupInvocations, p.limits.maxComputeWorkGroupSize[0]);
  c.shared_bytes = p.limits.maxComputeSharedMemorySize;

  bool timeline = false;
  if (c.api_version >= VK_API_VERSION_1_2) {
    VkPhysicalDeviceTimelineSemaphoreFeatures semaphores{
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_TIMELINE_SEMAPHORE_FEATURES,
        .pNext = nullptr,
        .timelineSemaphore = VK_FALSE};
    VkPhysicalDeviceFeatures2 features{
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, .pNext = &semaphores, .features = {}};
    vk.GetPhysicalDeviceFeatures2(device, &features);
    timeline = semaphores.timelineSemaphore;
  }

  // A family for compute alone, where there is one, does not queue behind graphics.
  std::uint32_t count = 0;
  vk.GetPhysicalDeviceQueueFamilyProperties(device, &count, nullptr);
  std::vector<VkQueueFamilyProperties> families(count);
  vk.GetPhysicalDeviceQueueFamilyProperties(device, &count, families.data());
  bool compute = false;
  for (std::uint32_t i = 0; i < count; ++i) {
    const VkQueueFlags flags = families[i].queueFlags;
    if (!(flags & VK_QUEUE_COMPUTE_BIT) || (compute && (flags & VK_QUEUE_GRAPHICS_BIT))) continue;
    compute = true;
    c.queue_family = i;
    c.timestamp_bits = families[i].timestampValidBits;
  }

  VkPhysicalDeviceMemoryProperties memory;
  vk.GetPhysicalDeviceMemoryProperties(device, &memory);
  for (std::uint32_t i = 0; i < memory.memoryHeapCount; ++i)
    if (memory.memoryHeaps[i].flags & VK_MEMORY_HEAP_DEVICE_LOCAL_BIT)
      c.memory_bytes = std::max<std::uint64_t>(c.memory_bytes, memory.memoryHeaps[i].size);

  for (const Quirk& quirk : quirks) {
    if (quirk.driver != c.driver_id) continue;
    c.quirks.push_back(&quirk);
    if (quirk.loop_limit) c.loop_limit = quirk.loop_limit;
  }
  // Work groups have 32 invocations: larger subgroups would be partly empty.
  constexpr VkSubgroupFeatureFlags operations =
      VK_SUBGROUP_FEATURE_BASIC_BIT | VK_SUBGROUP_FEATURE_VOTE_BIT | VK_SUBGROUP_FEATURE_SHUFFLE_BIT;
  c.shuffle = c.subgroup_size >= 8 && c.subgroup_size <= 32 &&
              (subgroup.supportedStages & VK_SHADER_STAGE_COMPUTE_BIT) &&
              (subgroup.supportedOperations & operations) == operations;
  c.texels = c.shuffle && c.type == VK_PHYSICAL_DEVICE_TYPE_CPU &&
             std::uint64_t{p.limits.maxTexelBufferElements} * 16 >= c.storage_range;
  c.unsuitable = fault(c, compute, timeline);
  return c;
}

}  // namespace bitr::vk
