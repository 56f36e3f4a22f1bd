// A graph in one arithmetic type on one backend, behind a face without either.
#pragma once

#include <bitr/assemble.hpp>

#include "api/pack.hpp"

namespace bitr {

namespace vk {
class Executor;
}

/// Runs a graph; reads tensors as doubles whatever the arithmetic. Throws Failure.
class Runner {
 public:
  virtual ~Runner() = default;
  virtual void run(const PackedBatch& batch, ThreadPool& pool) = 0;
  virtual std::vector<double> tensor(graph::TensorId id) const = 0;
  virtual std::vector<std::uint32_t> indices(graph::TensorId id) const = 0;
  virtual const graph::Graph& graph() const = 0;
  virtual std::size_t workspace_bytes() const = 0;
  /// Per node of the last run: how long it took, and when it began after the first one.
  virtual std::vector<double> node_milliseconds() const = 0;
  virtual std::vector<double> node_starts() const = 0;
  virtual PlanCounters counters() const { return {}; }
  /// What runs it, if that is Vulkan.
  virtual vk::Executor* vulkan() { return nullptr; }
};

std::unique_ptr<Runner> make_cpu_runner(graph::Graph graph, Precision precision, bool retain);
/// Throws Failure when the device cannot hold the capacity or run the graph.
std::unique_ptr<Runner> make_vulkan_runner(std::shared_ptr<const vk::Context> context, graph::Graph graph,
                                           const BatchShape& capacity, int key_points, bool retain);

/// The model's graph, folded or as defined, on the device. `retain`: every tensor can be read after a run.
Result<std::unique_ptr<Runner>> make_runner(const Device& device, const Model& model,
                                            const BatchShape& capacity, const PlanOptions& options,
                                            bool retain);

}  // namespace bitr
