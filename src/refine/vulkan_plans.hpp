// Transport plans on a Vulkan device.
#pragma once

#include <span>
#include <vector>

#include "core/thread_pool.hpp"
#include "refine/transport.hpp"
#include "vk/sinkhorn.hpp"

namespace bitr::refine {

class VulkanPlans {
 public:
  VulkanPlans(const vk::Context& context, ThreadPool& pool) : pool_(pool), sinkhorn_(context) {}

  /// Fills in weights and targets of all; plans that do not fit are left to the CPU.
  void run(std::span<PlanWanted* const> plans);
  /// Whether single precision holds it.
  static bool fits(const PlanWanted& wanted);
  /// Memory held on the device and for it.
  std::size_t bytes() const { return sinkhorn_.bytes(); }

 private:
  void run_together(std::span<PlanWanted* const> plans);
  ThreadPool& pool_;
  vk::Sinkhorn sinkhorn_;
};

}  // namespace bitr::refine
