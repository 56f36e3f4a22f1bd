// A Vulkan layer that loses devices. It passes everything through, but from the LOSE_DEVICE_AT-th
// submission of the process on (the first is 1) the device that was asked is lost. As Vulkan has it, nothing
// runs on it any more, and whatever submits or waits says so. The environment says the rest:
// LOSE_DEVICE_AT             a number, or several with commas: each loses the device that is asked then
// LOSE_DEVICE_WHILE_WAITING  set: that submission still succeeds, and the next wait finds out
// LOSE_DEVICE_AGAIN          set: every device that is asked later is lost, too
// LOSE_DEVICE_COUNT          a file that gets the number of submissions so far
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <map>
#include <mutex>
#include <sstream>
#include <utility>

#include "support/vulkan_layer.hpp"

namespace {

using bitr::test::erased;
using bitr::test::key_of;
using bitr::test::take_link;

struct Instance {
  VkInstance handle = VK_NULL_HANDLE;
  PFN_vkGetInstanceProcAddr next = nullptr;
};

struct Device {
  VkDevice handle = VK_NULL_HANDLE;
  PFN_vkGetDeviceProcAddr next = nullptr;
  bool lost = false;

  template <typename Function>
  Function function(const char* name) const {
    return reinterpret_cast<Function>(next(handle, name));
  }
};

std::mutex mutex;
std::map<void*, Instance> instances;
std::map<void*, Device> devices;
std::uint64_t submissions = 0;

template <typename Handle>
Instance instance_of(Handle handle) {
  const std::lock_guard lock(mutex);
  return instances.at(key_of(handle));
}

template <typename Handle>
Device device_of(Handle handle) {
  const std::lock_guard lock(mutex);
  return devices.at(key_of(handle));
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
  const std::lock_guard lock(mutex);
  instances[key_of(*instance)] = {*instance, next};
  return result;
}

VkResult VKAPI_CALL create_device(VkPhysicalDevice physical_device, const VkDeviceCreateInfo* info,
                                  const VkAllocationCallbacks* allocation, VkDevice* device) {
  const auto* link =
      take_link<VkLayerDeviceCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO);
  if (!link) return VK_ERROR_INITIALIZATION_FAILED;
  const Instance instance = instance_of(physical_device);
  const auto create = reinterpret_cast<PFN_vkCreateDevice>(instance.next(instance.handle, "vkCreateDevice"));
  const auto next = link->pfnNextGetDeviceProcAddr;
  const VkResult result = create(physical_device, info, allocation, device);
  if (result != VK_SUCCESS) return result;
  const std::lock_guard lock(mutex);
  devices[key_of(*device)] = {*device, next, false};
  return result;
}

void VKAPI_CALL destroy_device(VkDevice device, const VkAllocationCallbacks* allocation) {
  if (!device) return;
  const Device was = device_of(device);
  {
    const std::lock_guard lock(mutex);
    devices.erase(key_of(device));
  }
  was.function<PFN_vkDestroyDevice>("vkDestroyDevice")(device, allocation);
}

bool is_chosen(std::uint64_t submission) {
  const char* at = std::getenv("LOSE_DEVICE_AT");
  const bool again = std::getenv("LOSE_DEVICE_AGAIN");
  std::istringstream numbers(at ? at : "");
  for (std::uint64_t number = 0; numbers >> number; numbers.ignore())
    if (submission == number || (again && submission > number)) return true;
  return false;
}

enum class Fate { runs, vanishes, fails };

// Counts a submission.
Fate fate_of(VkQueue queue) {
  const std::lock_guard lock(mutex);
  ++submissions;
  if (const char* file = std::getenv("LOSE_DEVICE_COUNT")) std::ofstream(file) << submissions << '\n';
  Device& device = devices.at(key_of(queue));
  if (device.lost) return Fate::fails;
  if (!is_chosen(submissions)) return Fate::runs;
  // What runs already is let finish: it is terminated, as far as the program can tell.
  device.function<PFN_vkDeviceWaitIdle>("vkDeviceWaitIdle")(device.handle);
  device.lost = true;
  return std::getenv("LOSE_DEVICE_WHILE_WAITING") ? Fate::vanishes : Fate::fails;
}

VkResult VKAPI_CALL queue_submit(VkQueue queue, std::uint32_t count, const VkSubmitInfo* infos,
                                 VkFence fence) {
  switch (fate_of(queue)) {
    case Fate::vanishes:
      return VK_SUCCESS;
    case Fate::fails:
      return VK_ERROR_DEVICE_LOST;
    default:
      return device_of(queue).function<PFN_vkQueueSubmit>("vkQueueSubmit")(queue, count, infos, fence);
  }
}

VkResult VKAPI_CALL wait_semaphores(VkDevice device, const VkSemaphoreWaitInfo* info, std::uint64_t timeout) {
  const Device asked = device_of(device);
  if (asked.lost) return VK_ERROR_DEVICE_LOST;
  return asked.function<PFN_vkWaitSemaphores>("vkWaitSemaphores")(device, info, timeout);
}

VkResult VKAPI_CALL wait_fences(VkDevice device, std::uint32_t count, const VkFence* fences, VkBool32 all,
                                std::uint64_t timeout) {
  const Device asked = device_of(device);
  if (asked.lost) return VK_ERROR_DEVICE_LOST;
  return asked.function<PFN_vkWaitForFences>("vkWaitForFences")(device, count, fences, all, timeout);
}

VkResult VKAPI_CALL queue_idle(VkQueue queue) {
  const Device asked = device_of(queue);
  if (asked.lost) return VK_ERROR_DEVICE_LOST;
  return asked.function<PFN_vkQueueWaitIdle>("vkQueueWaitIdle")(queue);
}

VkResult VKAPI_CALL device_idle(VkDevice device) {
  const Device asked = device_of(device);
  if (asked.lost) return VK_ERROR_DEVICE_LOST;
  return asked.function<PFN_vkDeviceWaitIdle>("vkDeviceWaitIdle")(device);
}

PFN_vkVoidFunction VKAPI_CALL device_function(VkDevice device, const char* name);
PFN_vkVoidFunction VKAPI_CALL instance_function(VkInstance instance, const char* name);

PFN_vkVoidFunction own_function(const char* name) {
  const std::pair<const char*, PFN_vkVoidFunction> own[] = {
      {"vkGetInstanceProcAddr", erased(&instance_function)},
      {"vkGetDeviceProcAddr", erased(&device_function)},
      {"vkCreateInstance", erased(&create_instance)},
      {"vkCreateDevice", erased(&create_device)},
      {"vkDestroyDevice", erased(&destroy_device)},
      {"vkQueueSubmit", erased(&queue_submit)},
      {"vkWaitSemaphores", erased(&wait_semaphores)},
      {"vkWaitForFences", erased(&wait_fences)},
      {"vkQueueWaitIdle", erased(&queue_idle)},
      {"vkDeviceWaitIdle", erased(&device_idle)}};
  for (const auto& [own_name, function] : own)
    if (std::strcmp(name, own_name) == 0) return function;
  return nullptr;
}

PFN_vkVoidFunction VKAPI_CALL device_function(VkDevice device, const char* name) {
  if (const auto own = own_function(name)) return own;
  return device_of(device).next(device, name);
}

PFN_vkVoidFunction VKAPI_CALL instance_function(VkInstance instance, const char* name) {
  if (const auto own = own_function(name)) return own;
  if (!instance) return nullptr;
  return instance_of(instance).next(instance, name);
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
