#include "node_bench.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <optional>
#include <set>

#include "api/internal.hpp"
#include "model/build.hpp"
#include "model/load.hpp"
#include "scene.hpp"
#include "vk/kernel.hpp"

namespace bitr::bench {
namespace {

using graph::BatchLayout;
using graph::Graph;
using graph::Node;
using graph::TensorId;
using graph::TensorInfo;

std::vector<OpBench>& op_benches() {
  static std::vector<OpBench> all;
  return all;
}

Graph folded_graph(const ModelConfig& config) {
  return model::fold(
      model::build_graph(model::initial_weights(config, 1, Mode::scale_exact), Mode::scale_exact));
}

bool is_index(const TensorInfo& info) { return info.kind == graph::ElementKind::index; }

// The last one is kept: benchmarks of one size follow each other.
Scene& scene_of(const Graph& graph, const ModelConfig& config, Size size) {
  static std::optional<Scene> scene;
  if (!scene || !scene->is_of(graph, size)) {
    scene.reset();
    scene.emplace(graph, config, size);
  }
  return *scene;
}

// The node as a graph of its own.
struct Lone {
  Graph graph;
  std::map<TensorId, TensorId> id;  // in the network → here

  Lone(const Graph& whole, const Node& node) {
    Node here = node;
    for (auto* ids : {&here.inputs, &here.outputs})
      for (TensorId& tensor : *ids) {
        if (!id.count(tensor)) id[tensor] = graph.add(whole.tensors[tensor]);
        tensor = id[tensor];
      }
    graph.nodes.push_back(std::move(here));
  }
};

struct Pass {
  double seconds;  // on the device
  double wall;
};

// The node, with the tensors that it reads.
std::unique_ptr<graph::Executor> filled(const Device& device, const Lone& lone, Scene& scene,
                                        const std::vector<TensorId>& inputs) {
  auto executor = make_executor(device, lone.graph, scene.layout());
  executor->prepare(scene.layout());
  for (const TensorId id : inputs)
    if (const TensorId here = lone.id.at(id); is_index(lone.graph.tensors[here]))
      executor->write(here, scene.indices(id));
    else
      executor->write(here, scene.real(id));
  return executor;
}

// Bytes of the shaders that the node starts. What it records is data: no buffer is needed to look at it.
std::size_t spirv_bytes(const vk::Context& context, const Graph& graph, const BatchLayout& layout) {
  const Node& node = graph.nodes.front();
  vk::KernelContext site{context, {}, {}, layout};
  std::vector<vk::Slot> in, out;
  const auto add = [&](TensorId id, std::vector<TensorInfo>& infos, std::vector<vk::Slot>& slots) {
    const TensorInfo& info = graph.tensors[id];
    const std::size_t numbers = layout.rows(info.rows) * info.per_row * vk::padded(info.width);
    infos.push_back(info);
    slots.push_back({{VK_NULL_HANDLE, 0, 4 * numbers}, info.rows, info.per_row, info.width});
  };
  for (const TensorId id : node.inputs) add(id, site.in, in);
  for (const TensorId id : node.outputs) add(id, site.out, out);
  vk::Tables tables;
  for (const auto& [table, rows] : {std::pair(&tables.point, graph::Rows::point),
                                    {&tables.key, graph::Rows::key},
                                    {&tables.pair_key, graph::Rows::pair_key}})
    for (std::uint32_t s = 0; s < layout.segments(rows); ++s)
      for (auto row = static_cast<std::uint32_t>(layout.begin(rows, s)), i = 0u;
           row < layout.begin(rows, s + 1); row += vk::tile_rows, ++i)
        table->host_tiles.push_back(
            {s, row, std::min(row + vk::tile_rows, static_cast<std::uint32_t>(layout.begin(rows, s + 1))),
             i});
  const vk::KernelPtr kernel = vk::kernel_for(site, node.op);
  vk::Schedule schedule;
  kernel->record({schedule,
                  layout,
                  tables,
                  {VK_NULL_HANDLE, 0, 4 * kernel->constants().size()},
                  {VK_NULL_HANDLE, 0, kernel->scratch_bytes(layout)},
                  {},
                  {VK_NULL_HANDLE, 0, kernel->listed_input() < 0 ? 0 : kernel->list_bytes(layout)},
                  true,
                  in,
                  out});
  std::set<const vk::Shader*> shaders;
  for (const vk::Dispatch& work : schedule.dispatches())
    if (work.pipeline) shaders.insert(work.pipeline->shader);
  std::size_t bytes = 0;
  for (const vk::Shader* shader : shaders) bytes += shader->spirv.size_bytes();
  return bytes;
}

// `seconds` on the device where it has a clock, else until it has answered.
Pass timed(graph::Executor& node) {
  const auto start = std::chrono::steady_clock::now();
  node.run();
  const double wall = seconds_between(start, std::chrono::steady_clock::now());
  const double seconds = 1e-3 * node.node_milliseconds().front();
  return {seconds > 0 ? seconds : wall, wall};
}

void measure(benchmark::State& state, const Run& run, const Device& device, const OpBench& bench,
             const Graph& graph, const Node& node, Size size) {
  Scene& scene = scene_of(graph, bench.config, size);
  const Lone lone(graph, node);
  const Job job{graph, node, scene.layout()};
  const auto executor = filled(device, lone, scene, node.inputs);
  executor->run();
  double wall = 0;
  for (auto _ : state) {
    const Pass pass = timed(*executor);
    state.SetIterationTime(pass.seconds);
    wall += pass.wall;
  }
  if (!run.counters) {
    state.counters["wall_ms"] = benchmark::Counter(1e3 * wall, benchmark::Counter::kAvgIterations);
    state.counters["arena_bytes"] = static_cast<double>(executor->workspace_bytes());
    report_rates(state, device, bench.flops(job), job.bytes());
  }
  if (!Internal::context(device)) return;
  const graph::Counters counters = executor->counters();
  state.counters["dispatches"] = static_cast<double>(counters.dispatches);
  state.counters["barriers"] = static_cast<double>(counters.barriers);
  if (!run.counters)
    state.counters["spirv_bytes"] =
        static_cast<double>(spirv_bytes(*Internal::context(device), lone.graph, scene.layout()));
}

}  // namespace

double Job::bytes() const {
  const auto total = [&](const TensorInfo& info) { return 4.0 * rows(info) * info.per_row * info.width; };
  double bytes = 0, gathered = std::numeric_limits<double>::infinity();
  for (const TensorId id : node.inputs)
    if (const TensorInfo& info = graph.tensors[id]; is_index(info)) gathered = rows(info) * info.per_row;
  for (const TensorId id : std::set<TensorId>(node.inputs.begin(), node.inputs.end())) {
    const TensorInfo& info = graph.tensors[id];
    const double row = 4.0 * info.per_row * info.width;
    // Rows of others are read through the index: few centres do not read all of them.
    bytes += info.rows == out(0).rows ? total(info) : std::min(total(info), gathered * row);
  }
  for (const TensorId id : node.outputs) bytes += total(graph.tensors[id]);
  return bytes;
}

bool add(OpBench bench) {
  op_benches().push_back(std::move(bench));
  return true;
}

Estimate estimate_of(const Graph& graph, const BatchLayout& layout) {
  Estimate work;
  for (const Node& node : graph.nodes) {
    const Job job{graph, node, layout};
    work.bytes += job.bytes();
    for (const OpBench& bench : op_benches())
      if (bench.op == node.op.index()) work.flops += bench.flops(job);
  }
  return work;
}

std::vector<GeneratedPair> make_pairs(Size size) {
  std::vector<GeneratedPair> pairs;
  for (std::uint64_t i = 0; i < size.pairs; ++i)
    pairs.push_back(generate_pair("fragments", {.points = size.points, .seed = i}).value());
  return pairs;
}

void register_nodes(const Run& run) {
  std::ranges::sort(op_benches(), {}, &OpBench::op);
  for (const OpBench& bench : op_benches()) {
    // Lives as long as the benchmarks do.
    const auto graph = std::make_shared<const Graph>(folded_graph(bench.config));
    for (const Size size : bench.sizes) {
      if (run.counters && (size.points > 4096 || size.pairs > 1)) continue;
      for (const Node& node : graph->nodes)
        for (const Device& device : run.devices)
          if (node.op.index() == bench.op && (!bench.wanted || bench.wanted(node.name, size)))
            benchmark::RegisterBenchmark(
                (std::string(bench.name) + "/" + node.name + "/" + size.str() + "/" +
                 std::string(name(device.backend())))
                    .c_str(),
                [=, &bench, &node](benchmark::State& state) {
                  guarded(state, [&] { measure(state, run, device, bench, *graph, node, size); });
                })
                ->UseManualTime()
                ->Unit(benchmark::kMillisecond);
    }
  }
}

}  // namespace bitr::bench
