#include "vk/commands.hpp"

#include "core/failure.hpp"

namespace bitr::vk {

Commands::Commands(const Context& context) : context_(context) {
  const DeviceFunctions& vk = context_.vk();
  try {
    const VkCommandPoolCreateInfo pool{.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO,
                                       .pNext = nullptr,
                                       .flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT,
                                       .queueFamilyIndex = context_.queue_family()};
    check(vk.CreateCommandPool(context_.device(), &pool, context_.allocation(), &pool_),
          "vkCreateCommandPool");
    const VkSemaphoreTypeCreateInfo timeline{.sType = VK_STRUCTURE_TYPE_SEMAPHORE_TYPE_CREATE_INFO,
                                             .pNext = nullptr,
                                             .semaphoreType = VK_SEMAPHORE_TYPE_TIMELINE,
                                             .initialValue = 0};
    const VkSemaphoreCreateInfo semaphore{
        .sType = VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO, .pNext = &timeline, .flags = 0};
    check(vk.CreateSemaphore(context_.device(), &semaphore, context_.allocation(), &semaphore_),
          "vkCreateSemaphore");
    copies_ = buffers(1).front();
    buffers_.clear();
  } catch (...) {
    destroy();
    throw;
  }
}

Commands::~Commands() {
  try {
    if (!context_.lost()) wait();
  } catch (const Failure&) {
    // Lost while waiting: nothing runs any more.
  }
  destroy();
}

void Commands::destroy() noexcept {
  const DeviceFunctions& vk = context_.vk();
  if (semaphore_) vk.DestroySemaphore(context_.device(), semaphore_, context_.allocation());
  if (pool_) vk.DestroyCommandPool(context_.device(), pool_, context_.allocation());
}

const std::vector<VkCommandBuffer>& Commands::buffers(std::size_t count) {
  if (const std::size_t had = buffers_.size(); had < count) {
    std::vector<VkCommandBuffer> more(count - had);
    const VkCommandBufferAllocateInfo allocate{.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO,
                                               .pNext = nullptr,
                                               .commandPool = pool_,
                                               .level = VK_COMMAND_BUFFER_LEVEL_PRIMARY,
                                               .commandBufferCount = static_cast<std::uint32_t>(more.size())};
    check(context_.vk().AllocateCommandBuffers(context_.device(), &allocate, more.data()),
          "vkAllocateCommandBuffers");
    buffers_.insert(buffers_.end(), more.begin(), more.end());
  }
  return buffers_;
}

void Commands::begin(VkCommandBuffer commands, VkCommandBufferUsageFlags usage) const {
  const VkCommandBufferBeginInfo info{.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO,
                                      .pNext = nullptr,
                                      .flags = usage,
                                      .pInheritanceInfo = nullptr};
  check(context_.vk().BeginCommandBuffer(commands, &info), "vkBeginCommandBuffer");
}

void Commands::end(VkCommandBuffer commands) const {
  check(context_.vk().EndCommandBuffer(commands), "vkEndCommandBuffer");
}

void Commands::submit(VkCommandBuffer commands) {
  context_.submit(commands, semaphore_, submitted_ + 1);
  ++submitted_;
}

void Commands::wait() const {
  if (submitted_ > 0) context_.wait(semaphore_, submitted_);
}

void Commands::copy(const Range& from, const Range& to) {
  begin(copies_, VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT);
  const VkBufferCopy region{from.offset, to.offset, from.size};
  context_.vk().CmdCopyBuffer(copies_, from.buffer, to.buffer, 1, &region);
  const VkMemoryBarrier barrier{.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER,
                                .pNext = nullptr,
                                .srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT,
                                .dstAccessMask = VK_ACCESS_HOST_READ_BIT | VK_ACCESS_MEMORY_READ_BIT};
  context_.vk().CmdPipelineBarrier(copies_, VK_PIPELINE_STAGE_TRANSFER_BIT,
                                   VK_PIPELINE_STAGE_HOST_BIT | VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 0, 1,
                                   &barrier, 0, nullptr, 0, nullptr);
  end(copies_);
  submit(copies_);
  wait();
}

Timestamps::Timestamps(const Context& context, std::size_t nodes) : context_(context), ticks_(2 * nodes) {
  if (context_.capabilities().timestamp_bits == 0 || nodes == 0) return;
  const VkQueryPoolCreateInfo queries{.sType = VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO,
                                      .pNext = nullptr,
                                      .flags = 0,
                                      .queryType = VK_QUERY_TYPE_TIMESTAMP,
                                      .queryCount = static_cast<std::uint32_t>(ticks_.size()),
                                      .pipelineStatistics = 0};
  check(context_.vk().CreateQueryPool(context_.device(), &queries, context_.allocation(), &pool_),
        "vkCreateQueryPool");
}

Timestamps::~Timestamps() {
  if (pool_) context_.vk().DestroyQueryPool(context_.device(), pool_, context_.allocation());
}

void Timestamps::reset(VkCommandBuffer commands) const {
  if (pool_) context_.vk().CmdResetQueryPool(commands, pool_, 0, static_cast<std::uint32_t>(ticks_.size()));
}

void Timestamps::read(std::vector<double>& milliseconds, std::vector<double>& starts) {
  if (!pool_) return;
  check(context_.vk().GetQueryPoolResults(
            context_.device(), pool_, 0, static_cast<std::uint32_t>(ticks_.size()),
            ticks_.size() * sizeof(std::uint64_t), ticks_.data(), sizeof(std::uint64_t),
            VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT),
        "vkGetQueryPoolResults");
  const Capabilities& c = context_.capabilities();
  const std::uint64_t mask = c.timestamp_bits >= 64 ? ~0ull : (1ull << c.timestamp_bits) - 1;
  const auto since = [&](std::uint64_t later, std::uint64_t earlier) {
    return static_cast<double>((later - earlier) & mask) * static_cast<double>(c.timestamp_period) * 1e-6;
  };
  for (std::size_t n = 0; n < ticks_.size() / 2; ++n) {
    milliseconds[n] = since(ticks_[2 * n + 1], ticks_[2 * n]);
    starts[n] = since(ticks_[2 * n], ticks_[0]);
  }
}

}  // namespace bitr::vk
