#include "vk/capabilities.hpp"

#include <algorithm>
#include <cstring>

#include "core/failure.hpp"

namespace bitr::vk {
namespace {

constexpr Quirk quirks[] = {
    {.driver = VK_DRIVER_ID_MESA_LLVMPIPE,
     .reason = "stops an invocation without a word after 65,535 loop iterations, all loops together",
     .loop_limit = 65535},
    {.driver = VK_DRIVER_ID_MESA_LLVMPIPE,
     .reason = "gives an invocation that leaves a loop before others what it computes for those afterwards"},
};

constexpr std::uint32_t least_storage_buffers = 8, least_invocations = 128, least_shared = 16384;

// Kernels hand round eight loads at a time; their work groups have 32 invocations, so that larger subgroups
// would be partly empty.
constexpr std::uint32_t least_shared_by = 8, most_shared_by = 32;

// Drivers whose kernels have subgroups of the reported size, whether or not they say so.
constexpr VkDriverId fixed_subgroups[] = {VK_DRIVER_ID_MESA_LLVMPIPE, VK_DRIVER_ID_NVIDIA_PROPRIETARY};

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

bool has_extension(const InstanceFunctions& vk, VkPhysicalDevice device, const char* name) {
  std::uint32_t count = 0;
  if (vk.EnumerateDeviceExtensionProperties(device, nullptr, &count, nullptr) != VK_SUCCESS) return false;
  std::vector<VkExtensionProperties> all(count);
  if (vk.EnumerateDeviceExtensionProperties(device, nullptr, &count, all.data()) != VK_SUCCESS) return false;
  return std::ranges::any_of(all, [&](const VkExtensionProperties& extension) {
    return std::strcmp(extension.extensionName, name) == 0;
  });
}

// What subgroups a kernel may get. Drivers that choose a size for every kernel report the largest, or one of
// their own.
void find_subgroup_sizes(const InstanceFunctions& vk, VkPhysicalDevice device, bool size_control,
                         Capabilities& c) {
  if (std::ranges::find(fixed_subgroups, c.driver_id) != std::end(fixed_subgroups))
    c.least_subgroup = c.most_subgroup = c.subgroup_size;
  else
    c.most_subgroup = std::max(c.subgroup_size, 2 * most_shared_by);
  if (c.api_version < VK_API_VERSION_1_2 ||
      !has_extension(vk, device, VK_EXT_SUBGROUP_SIZE_CONTROL_EXTENSION_NAME))
    return;

  VkPhysicalDeviceSubgroupSizeControlProperties sizes{
      .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_SIZE_CONTROL_PROPERTIES,
      .pNext = nullptr,
      .minSubgroupSize = 1,
      .maxSubgroupSize = 1,
      .maxComputeWorkgroupSubgroups = 1,
      .requiredSubgroupSizeStages = 0};
  VkPhysicalDeviceProperties2 properties{
      .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, .pNext = &sizes, .properties = {}};
  vk.GetPhysicalDeviceProperties2(device, &properties);
  c.least_subgroup = sizes.minSubgroupSize;
  c.most_subgroup = sizes.maxSubgroupSize;
  if (!size_control) return;

  VkPhysicalDeviceSubgroupSizeControlFeatures control{
      .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_SIZE_CONTROL_FEATURES,
      .pNext = nullptr,
      .subgroupSizeControl = VK_FALSE,
      .computeFullSubgroups = VK_FALSE};
  VkPhysicalDeviceFeatures2 features{
      .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, .pNext = &control, .features = {}};
  vk.GetPhysicalDeviceFeatures2(device, &features);
  c.size_control = control.subgroupSizeControl;
  c.full_subgroups = control.computeFullSubgroups;
  // The smallest that will do: where a driver has a choice, large kernels have most registers then.
  const std::uint32_t size = std::max(least_shared_by, c.least_subgroup);
  if (!c.size_control || !(sizes.requiredSubgroupSizeStages & VK_SHADER_STAGE_COMPUTE_BIT) ||
      size > std::min(most_shared_by, c.most_subgroup) ||
      std::uint64_t{size} * sizes.maxComputeWorkgroupSubgroups < least_invocations)
    return;
  c.least_subgroup = c.most_subgroup = c.required_subgroup = size;
}

std::string tiers_of(const Capabilities& c) {
  std::string names;
  for (const Tier tier : {Tier::basic, Tier::shuffle, Tier::texels})
    if (c.executes(tier)) names += (names.empty() ? "" : ", ") + std::string(name(tier));
  return names;
}

}  // namespace

bool Capabilities::executes(Tier tier) const {
  return tier == Tier::basic || (tier == Tier::shuffle ? shares : texel_arrays);
}

void Capabilities::choose(std::optional<Tier> wanted) {
  // A GPU reads storage buffers as fast, and several at once.
  const Tier best = texel_arrays && type == VK_PHYSICAL_DEVICE_TYPE_CPU ? Tier::texels
                    : shares                                            ? Tier::shuffle
                                                                        : Tier::basic;
  const Tier chosen = wanted.value_or(best);
  if (!executes(chosen)) {
    const std::string sizes = least_subgroup == most_subgroup
                                  ? std::to_string(least_subgroup)
                                  : std::to_string(least_subgroup) + " to " + std::to_string(most_subgroup);
    const std::string reason = shares
                                   ? "needs texel buffers as large as storage buffers, which it has not"
                                   : "needs subgroups of " + std::to_string(least_shared_by) + " to " +
                                         std::to_string(most_shared_by) +
                                         " invocations with vote, shuffle and arithmetic, its have " + sizes;
    throw Failure(ErrorCode::unsupported, "tier " + std::string(bitr::name(chosen)) + " cannot run on " +
                                              name + ": it " + reason + "; it executes " + tiers_of(*this));
  }
  shuffle = chosen != Tier::basic;
  texels = chosen == Tier::texels;
}

Capabilities capabilities_of(const InstanceFunctions& vk, VkPhysicalDevice device, bool size_control) {
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
  find_subgroup_sizes(vk, device, size_control, c);
  constexpr VkSubgroupFeatureFlags operations = VK_SUBGROUP_FEATURE_BASIC_BIT | VK_SUBGROUP_FEATURE_VOTE_BIT |
                                                VK_SUBGROUP_FEATURE_SHUFFLE_BIT |
                                                VK_SUBGROUP_FEATURE_ARITHMETIC_BIT;
  c.shares = c.least_subgroup >= least_shared_by && c.most_subgroup <= most_shared_by &&
             (subgroup.supportedStages & VK_SHADER_STAGE_COMPUTE_BIT) &&
             (subgroup.supportedOperations & operations) == operations;
  c.texel_arrays = c.shares && std::uint64_t{p.limits.maxTexelBufferElements} * 16 >= c.storage_range;
  c.choose(std::nullopt);
  c.unsuitable = fault(c, compute, timeline);
  return c;
}

}  // namespace bitr::vk
