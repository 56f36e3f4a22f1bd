// Graphs on the device that a caller chose.
#pragma once

#include <bitr/assemble.hpp>
#include <memory>

#include "graph/executor.hpp"

namespace bitr {

struct ExecutorOptions {
  Precision precision = Precision::f32;
  bool retain = false;          ///< every tensor can be read after a run
  std::size_t guard_bytes = 0;  ///< untouchable memory behind every tensor (graph::Executor::guards_hold)
  /// What a Vulkan device does with a batch beyond the capacity: 0 refuses it, else memory grows to so many
  /// times its points. On the CPU memory grows by itself.
  double growth = 0;
};

/// `graph` is executable. `capacity`: the largest batch, in pairs, points and key points. `device` outlives
/// the executor. Throws Failure: `unsupported` for double on a Vulkan device; if that cannot hold the capacity
/// or run the graph.
std::unique_ptr<graph::Executor> make_executor(const Device& device, graph::Graph graph,
                                               const graph::BatchLayout& capacity,
                                               const ExecutorOptions& options = {});

/// The model's graph, folded or as defined, on the device. `retain`: every tensor can be read after a run.
Result<std::unique_ptr<graph::Executor>> make_executor(const Device& device, const Model& model,
                                                       const BatchShape& capacity, const PlanOptions& options,
                                                       bool retain);

}  // namespace bitr
