#include <utility>

#include "core/failure.hpp"
#include "vk/device.hpp"

namespace bitr::vk {
namespace {

std::uint32_t memory_type(const Context& context, std::uint32_t allowed, VkMemoryPropertyFlags wanted) {
  const auto& memory = context.memory();
  for (std::uint32_t i = 0; i < memory.memoryTypeCount; ++i)
    if ((allowed >> i & 1) && (memory.memoryTypes[i].propertyFlags & wanted) == wanted) return i;
  return memory.memoryTypeCount;
}

}  // namespace

Buffer::Buffer(const Context& context, VkDeviceSize bytes, bool host_visible)
    : context_(&context), bytes_(bytes) {
  const DeviceFunctions& vk = context.vk();
  const VkBufferCreateInfo info{.sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO,
                                .pNext = nullptr,
                                .flags = 0,
                                .size = bytes,
                                .usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT |
                                         VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT |
                                         VK_BUFFER_USAGE_UNIFORM_TEXEL_BUFFER_BIT |
                                         VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT,
                                .sharingMode = VK_SHARING_MODE_EXCLUSIVE,
                                .queueFamilyIndexCount = 0,
                                .pQueueFamilyIndices = nullptr};
  check(vk.CreateBuffer(context.device(), &info, context.allocation(), &buffer_), "vkCreateBuffer");
  VkMemoryRequirements needs;
  vk.GetBufferMemoryRequirements(context.device(), buffer_, &needs);
  const VkMemoryPropertyFlags wanted =
      host_visible ? VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT
                   : VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT;
  // Reading back from uncached memory is slow; Vulkan promises coherent memory, not cached coherent memory.
  std::uint32_t type =
      host_visible ? memory_type(context, needs.memoryTypeBits, wanted | VK_MEMORY_PROPERTY_HOST_CACHED_BIT)
                   : context.memory().memoryTypeCount;
  if (type == context.memory().memoryTypeCount) type = memory_type(context, needs.memoryTypeBits, wanted);
  const VkMemoryAllocateInfo allocate{.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO,
                                      .pNext = nullptr,
                                      .allocationSize = needs.size,
                                      .memoryTypeIndex = type};
  const VkResult result = vk.AllocateMemory(context.device(), &allocate, context.allocation(), &memory_);
  if (result != VK_SUCCESS) {
    vk.DestroyBuffer(context.device(), buffer_, context.allocation());
    if (result == VK_ERROR_DEVICE_LOST) check(result, "vkAllocateMemory");
    throw Failure(ErrorCode::internal, "the device has no " + std::to_string(needs.size) +
                                           " bytes of memory left (" + context.capabilities().name + ")");
  }
  context.count_allocation();
  check(vk.BindBufferMemory(context.device(), buffer_, memory_, 0), "vkBindBufferMemory");
  if (!host_visible) return;
  void* mapped = nullptr;
  check(vk.MapMemory(context.device(), memory_, 0, VK_WHOLE_SIZE, 0, &mapped), "vkMapMemory");
  mapped_ = static_cast<std::byte*>(mapped);
}

Buffer::~Buffer() {
  if (!context_) return;
  context_->vk().DestroyBuffer(context_->device(), buffer_, context_->allocation());
  context_->vk().FreeMemory(context_->device(), memory_, context_->allocation());
}

void Buffer::swap(Buffer& other) {
  std::swap(context_, other.context_);
  std::swap(buffer_, other.buffer_);
  std::swap(memory_, other.memory_);
  std::swap(bytes_, other.bytes_);
  std::swap(mapped_, other.mapped_);
}

}  // namespace bitr::vk
