// Runs a graph on a Vulkan device: memory and descriptors laid out once for a capacity, commands recorded
// once per batch layout and replayed.
#pragma once

#include <optional>

#include "graph/executor.hpp"
#include "graph/memory_plan.hpp"
#include "vk/commands.hpp"
#include "vk/host_buffers.hpp"
#include "vk/kernel.hpp"

namespace bitr::vk {

struct Capacity {
  std::size_t pairs = 1, points = 0;
  std::uint32_t key_points = 0;
  /// As many rows of every kind as that.
  graph::BatchLayout layout() const;
};

struct ExecutorOptions {
  bool retain = false;  ///< every tensor keeps its values after a run
  Barriers barriers = Barriers::needed;
  std::optional<std::uint64_t> shuffle =
      {};                              ///< run in a random legal order (with `retain`, so that many are)
  double submission_cost = most_cost;  ///< a new submission begins beyond this
  std::size_t guard_bytes = 0;         ///< untouchable memory behind every tensor, for tests
  /// What to do with a batch beyond the capacity: 0 refuses it, else memory grows to so many times its points.
  double growth = 0;
};

class Executor : public graph::Executor {
 public:
  /// `graph` holds operations that Vulkan runs. Allocates everything a batch within the capacity needs.
  Executor(std::shared_ptr<const Context> context, graph::Graph graph, const Capacity& capacity,
           const ExecutorOptions& options = {})
      : Executor(std::move(context), std::move(graph), capacity.layout(), options) {}
  /// The same for batches with as many clouds, points and key points as `largest` has.
  Executor(std::shared_ptr<const Context> context, graph::Graph graph, const graph::BatchLayout& largest,
           const ExecutorOptions& options = {});

  /// Records only if the batch differs from the last one. Failure (`invalid_argument`) for one beyond the
  /// capacity, if that may not grow.
  void prepare(const graph::BatchLayout& layout) override;
  /// Submits and waits.
  void run() override;
  /// The constants go to the device now; the next prepare() records again only what they changed the shapes
  /// of.
  void replace(graph::Graph graph) override;

  /// Records a whole pass over the host's buffers into the host's command buffer. The executor's memory is in
  /// use until that has run; a later record() or replace() makes it invalid. Throws Failure (`unsupported`)
  /// for a graph that reads more than positions.
  void record(VkCommandBuffer commands, const graph::BatchLayout& layout, const HostBuffers& host);

  const graph::Graph& graph() const override { return graph_; }
  const graph::BatchLayout& layout() const override { return layout_; }
  const Context& context() const { return *context_; }
  std::size_t workspace_bytes() const override;
  Counters counters() const override { return counters_; }
  const std::vector<double>& node_milliseconds() const override { return milliseconds_; }
  const std::vector<double>& node_starts() const override { return starts_; }
  bool guards_hold() const override;
  /// In staging memory: rows of `padded(width)` numbers, tight for index tensors.
  graph::TensorView input(graph::TensorId id) const override;
  /// In readback memory; with `retain` any tensor, which is then fetched from the device.
  graph::TensorView output(graph::TensorId id) const override;
  Slot slot(graph::TensorId id) const { return slots_[id]; }

 private:
  struct Submission {
    VkCommandBuffer commands;
    std::size_t begin, end;  // dispatches
  };
  // What a node has besides its tensors.
  struct NodeMemory {
    std::size_t inputs = 0, outputs = 0;  // tensors of its own
    graph::TensorId scratch = graph::no_tensor, saved = graph::no_tensor, lists = graph::no_tensor;
    bool saves = false, makes_lists = false;
  };
  void load(graph::Graph graph);
  graph::Graph own_graph() const;
  // `differentiated`: of every node, its gradient or what it is the gradient of; −1: none.
  void add_memory(const std::vector<int>& differentiated);
  graph::TensorId add_tensor(const std::string& name);
  void find_inputs();
  bool holds(const graph::BatchLayout& layout) const;
  void check_capacity(const graph::BatchLayout& layout) const;
  void grow(const graph::BatchLayout& layout);
  graph::TensorView view(graph::TensorId id, std::byte* data) const;
  void lay_out(const graph::BatchLayout& layout);
  void allocate(double slack);
  bool fits() const;
  std::size_t constant_bytes() const;
  void place_constants();
  void upload_constants();
  std::vector<std::size_t> tensor_bytes(const graph::BatchLayout& layout) const;
  void lay_out_tables();
  void make_schedule();
  void add_tables(Schedule& schedule) const;
  void add_nodes(Schedule& schedule) const;
  void record_all();

  std::shared_ptr<const Context> context_;
  graph::Graph graph_;
  std::size_t own_tensors_ = 0;  // so many are the graph's; the nodes' memory follows
  std::vector<graph::TensorId> inputs_, outputs_;
  std::vector<NodeMemory> memory_;
  graph::BatchLayout largest_;
  ExecutorOptions options_;
  std::vector<KernelPtr> kernels_;
  std::vector<Range> constants_;
  Buffer constant_buffer_, constant_staging_, arena_, table_buffer_, staging_, readback_;
  std::vector<std::size_t> capacities_;    // bytes per tensor
  std::vector<std::size_t> offsets_;       // in the arena, per tensor
  std::vector<std::size_t> input_offset_;  // in staging_, per input
  std::size_t table_bytes_ = 0;
  graph::BatchLayout layout_;
  bool prepared_ = false;
  bool recorded_ = false;  // submissions_ do what schedule_ says
  Tables tables_;
  Range centroids_;  // those of host_buffers' clouds, in table_buffer_
  std::vector<Slot> slots_;
  Schedule schedule_, host_schedule_;
  Recorder recorder_, host_recorder_;
  Counters counters_;
  std::vector<Submission> submissions_;
  std::vector<double> milliseconds_, starts_;
  Timestamps timestamps_;
  mutable Buffer fetched_;     // the tensor that output() was last asked for, if it is no output
  mutable Commands commands_;  // last: waits for the device before anything else goes
};

}  // namespace bitr::vk
