// One thread's way to the queue: command buffers, and a timeline that says what has been done.
#pragma once

#include "vk/schedule.hpp"

namespace bitr::vk {

class Commands {
 public:
  explicit Commands(const Context& context);
  /// Waits for what was submitted, unless the device is lost.
  ~Commands();
  Commands(const Commands&) = delete;
  Commands& operator=(const Commands&) = delete;

  /// So many command buffers, of which those of earlier calls stay the same.
  const std::vector<VkCommandBuffer>& buffers(std::size_t count);
  void begin(VkCommandBuffer commands, VkCommandBufferUsageFlags usage = 0) const;
  void end(VkCommandBuffer commands) const;
  /// Throw as Context::submit and wait.
  void submit(VkCommandBuffer commands);
  void wait() const;
  /// Submits a copy and waits for it.
  void copy(const Range& from, const Range& to);

 private:
  void destroy() noexcept;
  const Context& context_;
  VkCommandPool pool_ = VK_NULL_HANDLE;
  VkSemaphore semaphore_ = VK_NULL_HANDLE;
  std::uint64_t submitted_ = 0;  // the semaphore's value once all of it is done
  std::vector<VkCommandBuffer> buffers_;
  VkCommandBuffer copies_ = VK_NULL_HANDLE;
};

/// When each node of a graph began and ended. Nothing where the device has no clock.
class Timestamps {
 public:
  Timestamps(const Context& context, std::size_t nodes);
  ~Timestamps();
  Timestamps(const Timestamps&) = delete;
  Timestamps& operator=(const Timestamps&) = delete;

  VkQueryPool pool() const { return pool_; }
  void reset(VkCommandBuffer commands) const;
  /// Milliseconds of the last run: each node's duration, and its begin after the first one's.
  void read(std::vector<double>& milliseconds, std::vector<double>& starts);

 private:
  const Context& context_;
  VkQueryPool pool_ = VK_NULL_HANDLE;
  std::vector<std::uint64_t> ticks_;
};

}  // namespace bitr::vk
