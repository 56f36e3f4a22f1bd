#include "api/executor.hpp"

#include "api/internal.hpp"
#include "cpu/executor.hpp"
#include "model/build.hpp"
#include "model/weights.hpp"
#include "vk/executor.hpp"

namespace bitr {

std::unique_ptr<graph::Executor> make_executor(const Device& device, graph::Graph graph,
                                               const graph::BatchLayout& capacity,
                                               const ExecutorOptions& options) {
  const bool single = options.precision == Precision::f32;
  if (device.backend() == Backend::vulkan) {
    if (!single)
      throw Failure(ErrorCode::unsupported, device.name() + " computes in float: double is for the CPU");
    return std::make_unique<vk::Executor>(
        Internal::context(device), std::move(graph), capacity,
        vk::ExecutorOptions{
            .retain = options.retain, .guard_bytes = options.guard_bytes, .growth = options.growth});
  }
  const cpu::ExecutorOptions own{options.retain, options.guard_bytes};
  if (single) return std::make_unique<cpu::Executor<float>>(std::move(graph), Internal::pool(device), own);
  return std::make_unique<cpu::Executor<double>>(std::move(graph), Internal::pool(device), own);
}

Result<std::unique_ptr<graph::Executor>> make_executor(const Device& device, const Model& model,
                                                       const BatchShape& capacity, const PlanOptions& options,
                                                       bool retain) {
  const auto refuse = [&](const char* what) {
    return fail(ErrorCode::unsupported,
                std::string(what) + " runs on the CPU only, not on " + device.name() + " through Vulkan");
  };
  const bool vulkan = device.backend() == Backend::vulkan;
  if (vulkan && options.precision == Precision::f64) return refuse("precision f64");
  if (vulkan && options.as_defined) return refuse("the network as defined, unfolded,");
  const graph::Graph whole =
      model::build_graph(Internal::weights(model), options.mode.value_or(model.mode()));
  graph::Graph graph = options.as_defined ? model::expand(whole) : model::fold(whole);
  for (graph::Node& node : graph.nodes)
    if (auto* knn = std::get_if<ops::Knn>(&node.op)) knn->search = options.neighbors;
  if (std::string fault = graph::check_executable(graph); !fault.empty())
    return fail(ErrorCode::internal, fault);
  std::vector<std::uint32_t> clouds(2 * capacity.pairs, 0);
  if (!clouds.empty()) clouds.front() = static_cast<std::uint32_t>(capacity.points);
  return make_executor(device, std::move(graph),
                       {clouds, static_cast<std::uint32_t>(model.config().num_key_points)},
                       {.precision = options.precision, .retain = retain});
}

}  // namespace bitr
