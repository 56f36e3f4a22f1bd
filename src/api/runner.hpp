// A graph in one arithmetic type on one backend, behind a face without either.
#pragma once

#include <bitr/assemble.hpp>

#include "graph/graph.hpp"

namespace bitr {

namespace vk {
class Executor;
}

/// Clouds of a batch in the order of graph::BatchLayout, with the centroid each was moved by.
struct PackedBatch {
  graph::BatchLayout layout;
  std::vector<const CloudView*> clouds;
  std::vector<Vec3d> centroids;
  std::vector<std::vector<Vec3d>> offsets = {};  ///< per cloud, if the model reads them
};

/// Runs a graph; reads tensors as doubles whatever the arithmetic. Throws Failure.
class Runner {
 public:
  virtual ~Runner() = default;
  virtual void run(const PackedBatch& batch, cpu::ThreadPool& pool) = 0;
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

/// Rows of a cloud's attribute, minus `shift`, `stride` numbers apart; what is between them stays.
template <class T>
void copy_rows(const Vec3View& rows, const Vec3d& shift, std::size_t stride, T* to) {
  for (std::size_t i = 0; i < rows.count; ++i, to += stride) {
    const Vec3d row = rows[i];
    for (std::size_t a = 0; a < 3; ++a) to[a] = static_cast<T>(row[a] - shift[a]);
  }
}

/// Calls fill(tensor, rows, shift, first row) for every attribute of every cloud that the graph reads.
template <class Fill>
void for_each_input(const PackedBatch& batch, const graph::Graph& graph, Fill fill) {
  for (std::size_t c = 0; c < batch.clouds.size(); ++c) {
    const CloudView& cloud = *batch.clouds[c];
    const std::size_t row = batch.layout.cloud_offset[c];
    fill(graph.positions, cloud.positions, batch.centroids[c], row);
    if (graph.normals != graph::no_tensor) fill(graph.normals, cloud.normals, Vec3d{}, row);
    if (graph.colors != graph::no_tensor) fill(graph.colors, cloud.colors, Vec3d{}, row);
    if (graph.offsets != graph::no_tensor) fill(graph.offsets, Vec3View(batch.offsets[c]), Vec3d{}, row);
  }
}

}  // namespace bitr
