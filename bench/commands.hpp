// A schedule of the benchmarks' own, recorded once and run again and again.
#pragma once

#include "bench.hpp"
#include "vk/commands.hpp"

namespace bitr::bench {

class Commands {
 public:
  Commands(const vk::Context& context, const vk::Schedule& schedule) : recorder_(context), queue_(context) {
    buffer_ = queue_.buffers(1).front();
    queue_.begin(buffer_);
    recorder_.bind(schedule);
    recorder_.record(buffer_, schedule, 0, schedule.dispatches().size(), {});
    queue_.end(buffer_);
    run();
  }

  /// Seconds from submission to completion.
  double run() {
    const auto start = std::chrono::steady_clock::now();
    queue_.submit(buffer_);
    queue_.wait();
    return seconds_between(start, std::chrono::steady_clock::now());
  }

 private:
  vk::Recorder recorder_;
  vk::Commands queue_;  // waits for what was submitted before the recorder goes
  VkCommandBuffer buffer_ = VK_NULL_HANDLE;
};

}  // namespace bitr::bench
