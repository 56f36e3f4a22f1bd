// Runs a graph on a Vulkan device: memory and descriptors laid out once for a capacity, commands recorded
// once per batch layout and replayed.
#pragma once

#include <optional>

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
};

class Executor {
 public:
  /// `graph` holds operations that Vulkan runs. Allocates everything a batch within the capacity needs.
  Executor(std::shared_ptr<const Context> context, graph::Graph graph, const Capacity& capacity,
           const ExecutorOptions& options = {})
      : Executor(std::move(context), std::move(graph), capacity.layout(), options) {}
  /// The same for batches with as many clouds, points and key points as `largest` has.
  Executor(std::shared_ptr<const Context> context, graph::Graph graph, const graph::BatchLayout& largest,
           const ExecutorOptions& options = {});
  Executor(const Executor&) = delete;
  Executor& operator=(const Executor&) = delete;

  /// Lays out a batch within the capacity; records only if it differs from the last one.
  void prepare(const graph::BatchLayout& layout);
  /// After prepare(), before run(): an input's rows, `padded(width)` numbers each (tight for index tensors).
  float* input(graph::TensorId id) const;
  /// Submits and waits.
  void run();
  /// After run(): an output's rows, tight; with `retain` those of any tensor.
  std::vector<float> real(graph::TensorId id) const;
  std::vector<std::uint32_t> indices(graph::TensorId id) const;

  /// Other constants for the same operations, as cpu::Executor has it: `graph` differs in nothing but them
  /// and in how wide the tensors are that hold their gradients. They go to the device now. Before the next
  /// prepare(), which records again only what they changed the shapes of.
  void replace(graph::Graph graph);

  /// Records a whole pass over the host's buffers into the host's command buffer. The executor's memory is in
  /// use until that has run; a later record() or replace() makes it invalid. Throws Failure (`unsupported`)
  /// for a graph that reads more than positions.
  void record(VkCommandBuffer commands, const graph::BatchLayout& layout, const HostBuffers& host);

  const graph::Graph& graph() const { return graph_; }
  const graph::BatchLayout& layout() const { return layout_; }
  const Context& context() const { return *context_; }
  std::size_t workspace_bytes() const;
  const Counters& counters() const { return counters_; }
  /// Milliseconds per node of the last run; zeros where the device has no clock.
  const std::vector<double>& node_milliseconds() const { return milliseconds_; }
  /// Where each node begins, in milliseconds since the first one began.
  const std::vector<double>& node_starts() const { return starts_; }
  /// False if a kernel wrote behind a tensor.
  bool guards_hold() const;
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
  // `differentiated`: of every node, its gradient or what it is the gradient of; −1: none.
  void add_memory(const std::vector<int>& differentiated);
  graph::TensorId add_tensor(const std::string& name);
  void find_inputs();
  void check_capacity(const graph::BatchLayout& layout) const;
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
  std::vector<std::byte> read(graph::TensorId id) const;

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
  mutable Commands commands_;  // last: waits for the device before anything else goes
};

}  // namespace bitr::vk
