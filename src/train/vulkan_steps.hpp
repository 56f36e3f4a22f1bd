// Training graphs on a Vulkan device.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>

#include "api/pack.hpp"
#include "ops/loss.hpp"
#include "vk/executor.hpp"

namespace bitr::train {

/// A pair's row of the loss's input `truth` (ops/loss.hpp).
using Truth = std::array<double, ops::truth_width>;

class VulkanSteps {
 public:
  explicit VulkanSteps(const Device& device) : context_(device.context()) {}

  /// Graphs of every step but the first differ from the one before as vk::Executor::replace has it.
  void run(graph::Graph graph, const PackedBatch& batch, std::span<const Truth> truths);
  /// After run(): an output's rows.
  std::vector<double> numbers(graph::TensorId id) const;

 private:
  bool holds(const graph::BatchLayout& layout) const;

  const std::shared_ptr<const vk::Context> context_;
  std::size_t pairs_ = 0, points_ = 0;  // that the executor holds
  std::optional<vk::Executor> executor_;
};

}  // namespace bitr::train
