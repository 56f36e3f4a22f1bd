// A schedule of the benchmarks' own, recorded once and run again and again.
#pragma once

#include <chrono>

#include "bench.hpp"
#include "vk/schedule.hpp"

namespace bitr::bench {

class Commands {
 public:
  Commands(const vk::Context& context, const vk::Schedule& schedule) : context_(context), recorder_(context) {
    const vk::DeviceFunctions& vk = context.vk();
    const VkCommandPoolCreateInfo pool{.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO,
                                       .pNext = nullptr,
                                       .flags = 0,
                                       .queueFamilyIndex = context.queue_family()};
    vk::check(vk.CreateCommandPool(context.device(), &pool, context.allocation(), &pool_),
              "vkCreateCommandPool");
    const VkCommandBufferAllocateInfo allocate{.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO,
                                               .pNext = nullptr,
                                               .commandPool = pool_,
                                               .level = VK_COMMAND_BUFFER_LEVEL_PRIMARY,
                                               .commandBufferCount = 1};
    vk::check(vk.AllocateCommandBuffers(context.device(), &allocate, &commands_), "vkAllocateCommandBuffers");
    const VkSemaphoreTypeCreateInfo timeline{.sType = VK_STRUCTURE_TYPE_SEMAPHORE_TYPE_CREATE_INFO,
                                             .pNext = nullptr,
                                             .semaphoreType = VK_SEMAPHORE_TYPE_TIMELINE,
                                             .initialValue = 0};
    const VkSemaphoreCreateInfo semaphore{
        .sType = VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO, .pNext = &timeline, .flags = 0};
    vk::check(vk.CreateSemaphore(context.device(), &semaphore, context.allocation(), &semaphore_),
              "vkCreateSemaphore");
    const VkCommandBufferBeginInfo begin{.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO,
                                         .pNext = nullptr,
                                         .flags = 0,
                                         .pInheritanceInfo = nullptr};
    vk::check(vk.BeginCommandBuffer(commands_, &begin), "vkBeginCommandBuffer");
    recorder_.bind(schedule);
    recorder_.record(commands_, schedule, 0, schedule.works().size(), {});
    vk::check(vk.EndCommandBuffer(commands_), "vkEndCommandBuffer");
    run();
  }
  ~Commands() {
    context_.vk().DestroySemaphore(context_.device(), semaphore_, context_.allocation());
    context_.vk().DestroyCommandPool(context_.device(), pool_, context_.allocation());
  }
  Commands(const Commands&) = delete;
  Commands& operator=(const Commands&) = delete;

  /// Seconds from submission to completion.
  double run() {
    const auto start = std::chrono::steady_clock::now();
    context_.submit(commands_, semaphore_, ++signalled_);
    context_.wait(semaphore_, signalled_);
    return seconds_between(start, std::chrono::steady_clock::now());
  }

 private:
  const vk::Context& context_;
  vk::Recorder recorder_;
  VkCommandPool pool_ = VK_NULL_HANDLE;
  VkCommandBuffer commands_ = VK_NULL_HANDLE;
  VkSemaphore semaphore_ = VK_NULL_HANDLE;
  std::uint64_t signalled_ = 0;
};

}  // namespace bitr::bench
