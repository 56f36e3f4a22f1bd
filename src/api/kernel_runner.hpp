// One operation on either backend, fed from and read into the caller's memory.
#pragma once

#include <bitr/device.hpp>
#include <memory>
#include <span>
#include <variant>

#include "graph/graph.hpp"

namespace bitr {

template <class T>
using Numbers = std::variant<std::span<const T>, std::span<const std::uint32_t>>;
template <class T>
using Room = std::variant<std::span<T>, std::span<std::uint32_t>>;

/// Keeps its memory between runs. Throws Failure.
template <class T>
class KernelRunner {
 public:
  virtual ~KernelRunner() = default;
  /// `inputs`: of the graph's first tensors, in their order. `result` becomes the graph's.
  virtual void run(const graph::BatchLayout& layout, std::span<const Numbers<T>> inputs, Room<T> result) = 0;
  virtual std::size_t workspace_bytes() const = 0;
};

/// For a graph of one node. Throws Failure (`unsupported`) for double on a Vulkan device.
template <class T>
std::unique_ptr<KernelRunner<T>> make_kernel_runner(const Device& device, graph::Graph graph);

}  // namespace bitr
