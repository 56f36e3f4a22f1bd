// What the library itself reaches behind the public classes.
#pragma once

#include <bitr/assemble.hpp>
#include <memory>
#include <utility>

#include "core/thread_pool.hpp"

namespace bitr {

struct Internal {
  static ThreadPool& pool(const Device& device) { return *device.pool_; }
  /// Null on the CPU.
  static const std::shared_ptr<vk::Context>& context(const Device& device) { return device.context_; }
  static Device device(std::shared_ptr<ThreadPool> pool, std::shared_ptr<vk::Context> context = nullptr) {
    return Device(std::move(pool), std::move(context));
  }
  /// The CPU, with the threads of another device.
  static Device cpu_of(const Device& other) { return Device(other.pool_, nullptr); }

  static const model::Weights& weights(const Model& model) { return *model.weights_; }
  static Model model(std::shared_ptr<const model::Weights> weights) { return Model(std::move(weights)); }

  static Plan::Impl& impl(Plan& plan) { return *plan.impl_; }
  static const Plan::Impl& impl(const Plan& plan) { return *plan.impl_; }
  static Plan plan(std::unique_ptr<Plan::Impl> impl);
};

}  // namespace bitr
