// What Vulkan layers of the tests have in common: finding the next one.
#pragma once

#include <vulkan/vk_layer.h>

namespace bitr::test {

/// The loader's table, which a handle begins with: a device and its queues have one in common, so have an
/// instance and its physical devices.
template <typename Handle>
void* key_of(Handle handle) {
  return *reinterpret_cast<void**>(handle);
}

/// The loader's link to the next layer; the next one gets its own.
template <typename Info>
auto* take_link(const void* chain, VkStructureType type) {
  auto* info = static_cast<Info*>(const_cast<void*>(chain));
  while (info && !(info->sType == type && info->function == VK_LAYER_LINK_INFO))
    info = static_cast<Info*>(const_cast<void*>(info->pNext));
  auto* link = info ? info->u.pLayerInfo : nullptr;
  if (link) info->u.pLayerInfo = link->pNext;
  return link;
}

template <typename Function>
PFN_vkVoidFunction erased(Function function) {
  return reinterpret_cast<PFN_vkVoidFunction>(function);
}

}  // namespace bitr::test
