// One operation on either backend, fed from and read into the caller's memory.
#pragma once

#include <span>
#include <variant>

#include "api/executor.hpp"

namespace bitr {

template <class T>
using Numbers = std::variant<std::span<const T>, std::span<const std::uint32_t>>;
template <class T>
using Room = std::variant<std::span<T>, std::span<std::uint32_t>>;

/// Keeps its memory between runs. Throws Failure.
template <class T>
class KernelRunner {
 public:
  /// For a graph of one node. Failure (`unsupported`) for double on a Vulkan device.
  KernelRunner(const Device& device, graph::Graph graph);
  /// `inputs`: of the graph's first tensors, in their order. `result` becomes the graph's.
  void run(const graph::BatchLayout& layout, std::span<const Numbers<T>> inputs, Room<T> result);
  std::size_t workspace_bytes() const { return executor_ ? executor_->workspace_bytes() : 0; }

 private:
  Device device_;
  graph::Graph graph_;                         // until there is an executor
  std::unique_ptr<graph::Executor> executor_;  // from the first run on, which says how much it has to hold
};

}  // namespace bitr
