// Runs a graph on the CPU in one arithmetic type.
#pragma once

#include <string>
#include <vector>

#include "cpu/kernel.hpp"
#include "graph/graph.hpp"
#include "graph/memory_plan.hpp"

namespace bitr::cpu {

template <class T>
class Executor {
 public:
  /// `graph` holds executable operations only. `retain`: every tensor keeps its values after a run.
  Executor(graph::Graph graph, bool retain);

  /// Lays the arena out for this batch; the arena only ever grows, when a batch is larger
  /// than all before it.
  void prepare(const graph::BatchLayout& layout);
  /// After prepare(), before run(): where to write positions, normals, colours.
  /// After run(): where to read outputs, and with `retain` any tensor.
  template <class U = T>
  U* data(graph::TensorId id) const {
    return slots_[id].template as<U>();
  }
  void run(ThreadPool& pool);
  /// Other constants for the same operations: `graph` differs in nothing but them and in how wide the tensors
  /// are that hold their gradients. Before the next prepare().
  void replace(graph::Graph graph);

  const graph::Graph& graph() const { return graph_; }
  const graph::BatchLayout& layout() const { return layout_; }
  std::size_t workspace_bytes() const { return arena_bytes_; }
  /// Milliseconds per node of the last run.
  const std::vector<double>& node_milliseconds() const { return milliseconds_; }

 private:
  graph::Graph graph_;
  bool retain_;
  std::vector<KernelPtr<T>> kernels_;  // one per node
  graph::BatchLayout layout_;
  std::unique_ptr<std::byte[]> arena_;
  std::size_t arena_bytes_ = 0;
  std::vector<Slot> slots_;
  std::vector<double> milliseconds_;
};

}  // namespace bitr::cpu
