// Whole forward passes, from the host's clouds to poses.
#include <bitr/assemble.hpp>

#include "api/internal.hpp"
#include "model/build.hpp"
#include "model/weights.hpp"
#include "node_bench.hpp"

namespace bitr::bench {
namespace {

constexpr std::uint32_t points = 1024;

// Results carry errors of their own; here they end the benchmark.
auto value(auto result) {
  if (!result) throw std::runtime_error(result.error().message);
  return std::move(*result);
}

void measure(benchmark::State& state, const Run& run, const Device& device, Size size) {
  const std::vector<GeneratedPair> clouds = make_pairs(size);
  std::vector<CloudPair> pairs;
  for (const GeneratedPair& pair : clouds) pairs.push_back({pair.source, pair.reference});
  const Model model = value(untrained_model());
  Plan plan = value(make_plan(device, model, shape_of(pairs)));
  const auto pass = [&] { value(assemble(plan, pairs, {.diagnostics = false})); };
  pass();
  double device_ms = 0;
  for (auto _ : state) {
    pass();
    for (const StageTime& stage : plan.profile()) device_ms += stage.milliseconds;
  }
  state.counters["arena_bytes"] = static_cast<double>(plan.workspace_bytes());
  if (Internal::context(device)) {
    const PlanCounters counters = plan.counters();
    state.counters["dispatches"] = static_cast<double>(counters.dispatches);
    state.counters["barriers"] = static_cast<double>(counters.barriers);
    state.counters["submissions"] = static_cast<double>(counters.submissions);
  }
  if (run.counters) return;
  state.SetItemsProcessed(state.iterations() * size.pairs);
  state.counters["device_ms"] = benchmark::Counter(device_ms, benchmark::Counter::kAvgIterations);
  // The bytes are those of the operations one by one: what a pass moves if nothing stays in a cache between
  // them.
  const graph::BatchLayout layout(std::vector(2 * size.pairs, size.points),
                                  static_cast<std::uint32_t>(model.config().num_key_points));
  const Estimate work =
      estimate_of(model::fold(model::build_graph(Internal::weights(model), model.mode())), layout);
  report_rates(state, device, work.flops, work.bytes);
}

}  // namespace

void register_model(const Run& run) {
  for (const std::uint32_t pairs : {1, 4, 16, 64}) {
    if (run.counters && pairs > 4) continue;
    const Size size{points, pairs};
    register_whole(run, "model/" + size.str(),
                   [=](benchmark::State& state, const Device& device) { measure(state, run, device, size); });
  }
}

}  // namespace bitr::bench
