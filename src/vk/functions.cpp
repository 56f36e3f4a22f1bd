#include "vk/functions.hpp"

#include <dlfcn.h>

#include <string>

#include "core/failure.hpp"

namespace bitr::vk {
namespace {

[[noreturn]] void missing(const char* name) {
  throw Failure(ErrorCode::unsupported, std::string("the Vulkan driver has no vk") + name);
}

}  // namespace

InstanceFunctions::InstanceFunctions(PFN_vkGetInstanceProcAddr get, VkInstance instance) {
#define BITR_VK_LOAD(name)                                          \
  name = reinterpret_cast<PFN_vk##name>(get(instance, "vk" #name)); \
  if (!name) missing(#name);
  BITR_VK_INSTANCE_FUNCTIONS(BITR_VK_LOAD)
#undef BITR_VK_LOAD
  CreateDebugUtilsMessengerEXT =
      reinterpret_cast<PFN_vkCreateDebugUtilsMessengerEXT>(get(instance, "vkCreateDebugUtilsMessengerEXT"));
  DestroyDebugUtilsMessengerEXT =
      reinterpret_cast<PFN_vkDestroyDebugUtilsMessengerEXT>(get(instance, "vkDestroyDebugUtilsMessengerEXT"));
}

DeviceFunctions::DeviceFunctions(PFN_vkGetDeviceProcAddr get, VkDevice device) {
#define BITR_VK_LOAD(name)                                        \
  name = reinterpret_cast<PFN_vk##name>(get(device, "vk" #name)); \
  if (!name) missing(#name);
  BITR_VK_DEVICE_FUNCTIONS(BITR_VK_LOAD)
#undef BITR_VK_LOAD
}

PFN_vkGetInstanceProcAddr system_loader() {
  // Never closed: drivers keep threads that outlive any instance.
  static void* const library = [] {
    void* opened = dlopen("libvulkan.so.1", RTLD_NOW | RTLD_LOCAL);
    return opened ? opened : dlopen("libvulkan.so", RTLD_NOW | RTLD_LOCAL);
  }();
  if (!library) throw Failure(ErrorCode::no_device, "no Vulkan loader: libvulkan.so.1 is not installed");
  return reinterpret_cast<PFN_vkGetInstanceProcAddr>(dlsym(library, "vkGetInstanceProcAddr"));
}

}  // namespace bitr::vk
