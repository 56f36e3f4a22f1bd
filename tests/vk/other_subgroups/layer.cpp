// A Vulkan layer that makes a driver look like one with other subgroups; kernels run as without it.
// The environment says how, each variable but for the last a number:
// SUBGROUPS_REPORTED  the subgroup size
// SUBGROUPS_LEAST     minSubgroupSize; the driver then counts as one that this library does not know
// SUBGROUPS_MOST      maxSubgroupSize
// SUBGROUPS_STAGES    requiredSubgroupSizeStages
// SUBGROUPS_HIDDEN    set: VK_EXT_subgroup_size_control is not there; the driver counts as unknown, too
// SUBGROUPS_LOG       a file that gets a line for the device, "device" and which features of the extension it
//                     enables, and one for each pipeline: the size that it requires, or 0, and 1 if only full
//                     subgroups will do
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <map>
#include <mutex>
#include <utility>
#include <vector>

#include "support/vulkan_layer.hpp"

namespace {

using bitr::test::erased;
using bitr::test::key_of;
using bitr::test::take_link;

// The next layer's functions, asked for while the instance is made: later on the loader, which is the last to be asked,
// gives those of the first layer.
struct Instance {
  VkInstance handle = VK_NULL_HANDLE;
  PFN_vkGetInstanceProcAddr next = nullptr;
  PFN_vkCreateDevice create_device = nullptr;
  PFN_vkGetPhysicalDeviceProperties2 get_properties = nullptr;
  PFN_vkEnumerateDeviceExtensionProperties enumerate_extensions = nullptr;
};

std::mutex mutex;
std::map<void*, Instance> instances;
std::map<void*, PFN_vkGetDeviceProcAddr> devices;

template <typename Handle>
Instance instance_of(Handle handle) {
  const std::lock_guard lock(mutex);
  return instances.at(key_of(handle));
}

template <typename Function>
Function next_of_device(VkDevice device, const char* name) {
  const std::lock_guard lock(mutex);
  return reinterpret_cast<Function>(devices.at(key_of(device))(device, name));
}

void replace(const char* variable, std::uint32_t& number) {
  if (const char* text = std::getenv(variable))
    number = static_cast<std::uint32_t>(std::strtoul(text, nullptr, 10));
}

void log(const char* first, std::uint32_t a, std::uint32_t b) {
  if (const char* file = std::getenv("SUBGROUPS_LOG"))
    std::ofstream(file, std::ios::app) << first << a << ' ' << b << '\n';
}

template <typename Wanted>
const Wanted* find(const void* chain, VkStructureType type) {
  const auto* at = static_cast<const VkBaseInStructure*>(chain);
  while (at && at->sType != type) at = at->pNext;
  return reinterpret_cast<const Wanted*>(at);
}

VkResult VKAPI_CALL create_instance(const VkInstanceCreateInfo* info, const VkAllocationCallbacks* allocation,
                                    VkInstance* instance) {
  const auto* link =
      take_link<VkLayerInstanceCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO);
  if (!link) return VK_ERROR_INITIALIZATION_FAILED;
  const auto next = link->pfnNextGetInstanceProcAddr;
  const auto create = reinterpret_cast<PFN_vkCreateInstance>(next(nullptr, "vkCreateInstance"));
  const VkResult result = create(info, allocation, instance);
  if (result != VK_SUCCESS) return result;
  const auto function = [&]<typename Function>(Function& to, const char* name) {
    to = reinterpret_cast<Function>(next(*instance, name));
  };
  Instance made{.handle = *instance, .next = next};
  function(made.create_device, "vkCreateDevice");
  function(made.get_properties, "vkGetPhysicalDeviceProperties2");
  function(made.enumerate_extensions, "vkEnumerateDeviceExtensionProperties");
  const std::lock_guard lock(mutex);
  instances[key_of(*instance)] = made;
  return result;
}

VkResult VKAPI_CALL create_device(VkPhysicalDevice physical_device, const VkDeviceCreateInfo* info,
                                  const VkAllocationCallbacks* allocation, VkDevice* device) {
  const auto* link =
      take_link<VkLayerDeviceCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO);
  if (!link) return VK_ERROR_INITIALIZATION_FAILED;
  const auto create = instance_of(physical_device).create_device;
  const auto next = link->pfnNextGetDeviceProcAddr;
  const VkResult result = create(physical_device, info, allocation, device);
  if (result != VK_SUCCESS) return result;
  const auto* control = find<VkPhysicalDeviceSubgroupSizeControlFeatures>(
      info->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_SIZE_CONTROL_FEATURES);
  log("device ", control ? control->subgroupSizeControl : 0, control ? control->computeFullSubgroups : 0);
  const std::lock_guard lock(mutex);
  devices[key_of(*device)] = next;
  return result;
}

void VKAPI_CALL get_properties(VkPhysicalDevice device, VkPhysicalDeviceProperties2* properties) {
  instance_of(device).get_properties(device, properties);
  for (auto* at = static_cast<VkBaseOutStructure*>(properties->pNext); at; at = at->pNext) {
    if (at->sType == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_PROPERTIES) {
      replace("SUBGROUPS_REPORTED", reinterpret_cast<VkPhysicalDeviceSubgroupProperties*>(at)->subgroupSize);
    } else if (at->sType == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_SIZE_CONTROL_PROPERTIES) {
      auto& sizes = *reinterpret_cast<VkPhysicalDeviceSubgroupSizeControlProperties*>(at);
      replace("SUBGROUPS_LEAST", sizes.minSubgroupSize);
      replace("SUBGROUPS_MOST", sizes.maxSubgroupSize);
      replace("SUBGROUPS_STAGES", sizes.requiredSubgroupSizeStages);
    } else if (at->sType == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DRIVER_PROPERTIES) {
      if (std::getenv("SUBGROUPS_HIDDEN") || std::getenv("SUBGROUPS_LEAST"))
        reinterpret_cast<VkPhysicalDeviceDriverProperties*>(at)->driverID = VkDriverId(0);
    }
  }
}

VkResult VKAPI_CALL enumerate_extensions(VkPhysicalDevice device, const char* layer, std::uint32_t* count,
                                         VkExtensionProperties* properties) {
  const VkResult result = instance_of(device).enumerate_extensions(device, layer, count, properties);
  if (!properties || !std::getenv("SUBGROUPS_HIDDEN")) return result;
  for (std::uint32_t i = 0; i < *count; ++i)
    if (std::strcmp(properties[i].extensionName, VK_EXT_SUBGROUP_SIZE_CONTROL_EXTENSION_NAME) == 0)
      std::strcpy(properties[i].extensionName, "VK_BITR_hidden");
  return result;
}

// The driver is asked for none of the sizes that it does not have.
VkResult VKAPI_CALL create_pipelines(VkDevice device, VkPipelineCache cache, std::uint32_t count,
                                     const VkComputePipelineCreateInfo* infos,
                                     const VkAllocationCallbacks* allocation, VkPipeline* pipelines) {
  std::vector<VkComputePipelineCreateInfo> plain(infos, infos + count);
  for (VkComputePipelineCreateInfo& info : plain) {
    const auto* size = find<VkPipelineShaderStageRequiredSubgroupSizeCreateInfo>(
        info.stage.pNext, VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_REQUIRED_SUBGROUP_SIZE_CREATE_INFO);
    log("", size ? size->requiredSubgroupSize : 0,
        info.stage.flags & VK_PIPELINE_SHADER_STAGE_CREATE_REQUIRE_FULL_SUBGROUPS_BIT ? 1 : 0);
    info.stage.pNext = nullptr;
    info.stage.flags = 0;
  }
  return next_of_device<PFN_vkCreateComputePipelines>(device, "vkCreateComputePipelines")(
      device, cache, count, plain.data(), allocation, pipelines);
}

PFN_vkVoidFunction VKAPI_CALL device_function(VkDevice device, const char* name);
PFN_vkVoidFunction VKAPI_CALL instance_function(VkInstance instance, const char* name);

PFN_vkVoidFunction own_function(const char* name) {
  const std::pair<const char*, PFN_vkVoidFunction> own[] = {
      {"vkGetInstanceProcAddr", erased(&instance_function)},
      {"vkGetDeviceProcAddr", erased(&device_function)},
      {"vkCreateInstance", erased(&create_instance)},
      {"vkCreateDevice", erased(&create_device)},
      {"vkGetPhysicalDeviceProperties2", erased(&get_properties)},
      {"vkEnumerateDeviceExtensionProperties", erased(&enumerate_extensions)},
      {"vkCreateComputePipelines", erased(&create_pipelines)}};
  for (const auto& [own_name, function] : own)
    if (std::strcmp(name, own_name) == 0) return function;
  return nullptr;
}

PFN_vkVoidFunction VKAPI_CALL device_function(VkDevice device, const char* name) {
  if (const auto own = own_function(name)) return own;
  return next_of_device<PFN_vkVoidFunction>(device, name);
}

PFN_vkVoidFunction VKAPI_CALL instance_function(VkInstance instance, const char* name) {
  if (const auto own = own_function(name)) return own;
  if (!instance) return nullptr;
  const Instance known = instance_of(instance);
  return known.next(known.handle, name);
}

}  // namespace

extern "C" VK_LAYER_EXPORT VkResult VKAPI_CALL
vkNegotiateLoaderLayerInterfaceVersion(VkNegotiateLayerInterface* negotiated) {
  negotiated->loaderLayerInterfaceVersion = CURRENT_LOADER_LAYER_INTERFACE_VERSION;
  negotiated->pfnGetInstanceProcAddr = &instance_function;
  negotiated->pfnGetDeviceProcAddr = &device_function;
  negotiated->pfnGetPhysicalDeviceProcAddr = nullptr;
  return VK_SUCCESS;
}
