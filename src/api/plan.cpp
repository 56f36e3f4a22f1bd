#include "api/plan.hpp"

#include <limits>

#include "core/guarded.hpp"
#include "model/build.hpp"
#include "model/weights.hpp"

namespace bitr {

Result<std::unique_ptr<Runner>> make_runner(const Device& device, const Model& model,
                                            const BatchShape& capacity, const PlanOptions& options,
                                            bool retain) {
  const bool vulkan = device.backend() == Backend::vulkan;
  const auto refuse = [&](const char* what) {
    return fail(ErrorCode::unsupported,
                std::string(what) + " runs on the CPU only, not on " + device.name() + " through Vulkan");
  };
  if (vulkan && options.precision == Precision::f64) return refuse("precision f64");
  if (vulkan && options.as_defined) return refuse("the network as defined, unfolded,");
  const graph::Graph whole = model::build_graph(model.weights(), options.mode.value_or(model.mode()));
  graph::Graph graph = options.as_defined ? model::expand(whole) : model::fold(whole);
  for (graph::Node& node : graph.nodes)
    if (auto* knn = std::get_if<ops::Knn>(&node.op)) knn->search = options.neighbors;
  if (std::string fault = graph::check_executable(graph); !fault.empty())
    return fail(ErrorCode::internal, fault);
  if (!vulkan) return make_cpu_runner(std::move(graph), options.precision, retain);
  return make_vulkan_runner(device.context(), std::move(graph), capacity, model.config().num_key_points,
                            retain);
}

void Plan::Impl::begin() {
  timings.clear();
  profile.clear();
  passes.clear();
  began = Clock::now();
}

void Plan::Impl::run(const PackedBatch& batch) {
  const auto elapsed = [&] {
    return std::chrono::duration<double, std::milli>(Clock::now() - began).count();
  };
  StageTime pass{.stage = "forward pass", .start_ms = elapsed(), .pass = passes.size()};
  runner->run(batch, device.pool());
  pass.milliseconds = elapsed() - pass.start_ms;

  const auto& nodes = runner->graph().nodes;
  const std::vector<double> milliseconds = runner->node_milliseconds(), starts = runner->node_starts();
  timings.resize(nodes.size());
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    profile.push_back({nodes[i].name, milliseconds[i], pass.start_ms + starts[i], pass.pass});
    if (passes.empty())
      timings[i] = profile.back();
    else
      timings[i].milliseconds += milliseconds[i];
  }
  passes.push_back(std::move(pass));
}

Plan::Plan(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Plan::Plan(Plan&&) noexcept = default;
Plan& Plan::operator=(Plan&&) noexcept = default;
Plan::~Plan() = default;

const Device& Plan::device() const { return impl_->device; }
const Model& Plan::model() const { return impl_->model; }
const PlanOptions& Plan::options() const { return impl_->options; }
Mode Plan::mode() const { return impl_->mode; }
BatchShape Plan::capacity() const { return impl_->capacity; }
std::size_t Plan::workspace_bytes() const { return impl_->runner->workspace_bytes(); }
std::size_t Plan::operation_count() const { return impl_->runner->graph().nodes.size(); }
const std::vector<StageTime>& Plan::timings() const { return impl_->timings; }
const std::vector<StageTime>& Plan::profile() const { return impl_->profile; }
PlanCounters Plan::counters() const { return impl_->runner->counters(); }

Result<Plan> make_plan(const Device& device, const Model& model, const BatchShape& capacity,
                       const PlanOptions& options) {
  if (capacity.pairs == 0 || capacity.points == 0)
    return fail(ErrorCode::invalid_argument, "the plan's capacity is 0 pairs or 0 points");
  // Rows and neighbour indices are 32-bit.
  constexpr std::size_t most = std::numeric_limits<std::uint32_t>::max() / 64;
  const auto too_large = [&](std::size_t value, const char* what) {
    return fail(ErrorCode::invalid_argument, "the plan's capacity of " + std::to_string(value) + what +
                                                 " exceeds " + std::to_string(most));
  };
  if (capacity.points > most) return too_large(capacity.points, " points");
  if (capacity.pairs > most) return too_large(capacity.pairs, " pairs");
  return guarded([&]() -> Result<Plan> {
    auto runner = make_runner(device, model, capacity, options, false);
    if (!runner) return tl::unexpected(runner.error());
    return Plan(std::make_unique<Plan::Impl>(Plan::Impl{.device = device,
                                                        .model = model,
                                                        .capacity = capacity,
                                                        .options = options,
                                                        .mode = options.mode.value_or(model.mode()),
                                                        .runner = std::move(*runner)}));
  });
}

}  // namespace bitr
