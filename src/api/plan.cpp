#include "api/plan.hpp"

#include <limits>

#include "api/guarded.hpp"
#include "model/build.hpp"
#include "model/weights.hpp"

namespace bitr {
namespace {

template <class T>
class TypedRunner : public Runner {
 public:
  TypedRunner(graph::Graph graph, bool retain) : executor_(std::move(graph), retain) {}

  void run(const PackedBatch& batch, cpu::ThreadPool& pool) override {
    executor_.prepare(batch.layout);
    const graph::Graph& graph = executor_.graph();
    for (std::size_t c = 0; c < batch.clouds.size(); ++c) {
      const std::size_t row = batch.layout.cloud_offset[c];
      copy(batch.clouds[c]->positions, batch.centroids[c], executor_.data(graph.positions) + 3 * row);
      if (graph.normals != graph::no_tensor)
        copy(batch.clouds[c]->normals, {0, 0, 0}, executor_.data(graph.normals) + 3 * row);
      if (graph.colors != graph::no_tensor)
        copy(batch.clouds[c]->colors, {0, 0, 0}, executor_.data(graph.colors) + 3 * row);
    }
    executor_.run(pool);
  }
  std::vector<double> tensor(graph::TensorId id) const override {
    const T* data = executor_.data(id);
    return {data, data + size(id)};
  }
  std::vector<std::uint32_t> indices(graph::TensorId id) const override {
    const auto* data = executor_.template data<std::uint32_t>(id);
    return {data, data + size(id)};
  }
  const graph::Graph& graph() const override { return executor_.graph(); }
  std::size_t workspace_bytes() const override { return executor_.workspace_bytes(); }
  const std::vector<double>& node_milliseconds() const override { return executor_.node_milliseconds(); }

 private:
  std::size_t size(graph::TensorId id) const {
    const auto& info = executor_.graph().tensors[id];
    return executor_.layout().rows(info.rows) * info.per_row * info.width;
  }
  static void copy(const Vec3View& rows, const Vec3d& shift, T* to) {
    for (std::size_t i = 0; i < rows.count; ++i) {
      const Vec3d row = rows[i];
      for (int a = 0; a < 3; ++a) *to++ = static_cast<T>(row[a] - shift[a]);
    }
  }
  cpu::Executor<T> executor_;
};

}  // namespace

Result<std::unique_ptr<Runner>> make_runner(const Model& model, Mode mode, const PlanOptions& options,
                                            bool retain) {
  const graph::Graph whole = model::build_graph(model.weights(), mode);
  graph::Graph graph = options.as_defined ? model::expand(whole) : model::fold(whole);
  if (std::string fault = graph::check_executable(graph); !fault.empty())
    return fail(ErrorCode::internal, fault);
  if (options.precision == Precision::f32)
    return std::make_unique<TypedRunner<float>>(std::move(graph), retain);
  return std::make_unique<TypedRunner<double>>(std::move(graph), retain);
}

void Plan::Impl::run(const PackedBatch& batch) {
  runner->run(batch, device.pool());
  const auto& nodes = runner->graph().nodes;
  timings.resize(nodes.size());
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    timings[i].stage = nodes[i].name;
    timings[i].milliseconds += runner->node_milliseconds()[i];
  }
}

Plan::Plan(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Plan::Plan(Plan&&) noexcept = default;
Plan& Plan::operator=(Plan&&) noexcept = default;
Plan::~Plan() = default;

const Model& Plan::model() const { return impl_->model; }
const PlanOptions& Plan::options() const { return impl_->options; }
Mode Plan::mode() const { return impl_->mode; }
BatchShape Plan::capacity() const { return impl_->capacity; }
std::size_t Plan::workspace_bytes() const { return impl_->runner->workspace_bytes(); }
std::size_t Plan::operation_count() const { return impl_->runner->graph().nodes.size(); }
const std::vector<StageTime>& Plan::timings() const { return impl_->timings; }

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
    const Mode mode = options.mode.value_or(model.mode());
    auto runner = make_runner(model, mode, options, false);
    if (!runner) return tl::unexpected(runner.error());
    return Plan(std::unique_ptr<Plan::Impl>(
        new Plan::Impl{device, model, capacity, options, mode, std::move(*runner), {}}));
  });
}

}  // namespace bitr
