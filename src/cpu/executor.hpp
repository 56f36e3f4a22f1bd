// Runs a graph on the CPU in one arithmetic type.
#pragma once

#include <memory>
#include <vector>

#include "core/thread_pool.hpp"
#include "cpu/kernel.hpp"
#include "graph/executor.hpp"
#include "graph/memory_plan.hpp"

namespace bitr::cpu {

struct ExecutorOptions {
  bool retain = false;          ///< every tensor keeps its values after a run
  std::size_t guard_bytes = 0;  ///< untouchable memory behind every tensor; then all of them are retained
};

template <class T>
class Executor : public graph::Executor {
 public:
  /// `graph` holds executable operations only. `pool` outlives the executor.
  Executor(graph::Graph graph, ThreadPool& pool, const ExecutorOptions& options = {});

  /// The arena only ever grows, when a batch is larger than all before it.
  void prepare(const graph::BatchLayout& layout) override;
  void run() override;
  void replace(graph::Graph graph) override;

  const graph::Graph& graph() const override { return graph_; }
  const graph::BatchLayout& layout() const override { return layout_; }
  std::size_t workspace_bytes() const override { return arena_bytes_; }
  const std::vector<double>& node_milliseconds() const override { return milliseconds_; }
  const std::vector<double>& node_starts() const override { return starts_; }
  bool guards_hold() const override;
  graph::TensorView input(graph::TensorId id) const override { return view(id); }
  graph::TensorView output(graph::TensorId id) const override { return view(id); }

  /// A tensor's numbers themselves: U is T, or std::uint32_t for indices.
  template <class U = T>
  U* data(graph::TensorId id) const {
    return slots_[id].template as<U>();
  }

 private:
  graph::TensorView view(graph::TensorId id) const;

  graph::Graph graph_;
  ThreadPool& pool_;
  ExecutorOptions options_;
  std::vector<KernelPtr<T>> kernels_;  // one per node
  graph::BatchLayout layout_;
  std::unique_ptr<std::byte[]> arena_;
  std::size_t arena_bytes_ = 0;
  std::vector<Slot> slots_;
  std::vector<std::size_t> sizes_;  // bytes per tensor, without its guard
  std::vector<double> milliseconds_, starts_;
};

}  // namespace bitr::cpu
