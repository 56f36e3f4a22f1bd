#include "api/plan.hpp"

#include <limits>

#include "api/internal.hpp"
#include "core/guarded.hpp"

namespace bitr {

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
  executor->prepare(batch.layout);
  fill_inputs(batch, *executor);
  executor->run();
  pass.milliseconds = elapsed() - pass.start_ms;

  const auto& nodes = executor->graph().nodes;
  const std::vector<double>&milliseconds = executor->node_milliseconds(), &starts = executor->node_starts();
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

Plan Internal::plan(std::unique_ptr<Plan::Impl> impl) { return Plan(std::move(impl)); }

Plan::Plan(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Plan::Plan(Plan&&) noexcept = default;
Plan& Plan::operator=(Plan&&) noexcept = default;
Plan::~Plan() = default;

const Device& Plan::device() const { return impl_->device; }
const Model& Plan::model() const { return impl_->model; }
const PlanOptions& Plan::options() const { return impl_->options; }
Mode Plan::mode() const { return impl_->mode; }
BatchShape Plan::capacity() const { return impl_->capacity; }
std::size_t Plan::workspace_bytes() const { return impl_->executor->workspace_bytes(); }
std::size_t Plan::operation_count() const { return impl_->executor->graph().nodes.size(); }
const std::vector<StageTime>& Plan::timings() const { return impl_->timings; }
const std::vector<StageTime>& Plan::profile() const { return impl_->profile; }
PlanCounters Plan::counters() const {
  const auto [dispatches, copies, barriers, submissions] = impl_->executor->counters();
  return {dispatches, copies, barriers, submissions};
}

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
    auto executor = make_executor(device, model, capacity, options, false);
    if (!executor) return tl::unexpected(executor.error());
    return Internal::plan(std::make_unique<Plan::Impl>(Plan::Impl{.device = device,
                                                                  .model = model,
                                                                  .capacity = capacity,
                                                                  .options = options,
                                                                  .mode = options.mode.value_or(model.mode()),
                                                                  .executor = std::move(*executor)}));
  });
}

}  // namespace bitr
