#include "api/plan.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

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

std::string cloud_label(std::size_t cloud, std::size_t pairs) {
  const std::string side = cloud < pairs ? "source" : "reference";
  return pairs == 1 ? side + " cloud" : side + " cloud of pair " + std::to_string(cloud % pairs);
}

// Finite numbers and some extent; returns the centroid.
Result<Vec3d> check_positions(const Vec3View& points, const std::string& label) {
  Vec3d sum{};
  Vec3d low, high;
  low.fill(std::numeric_limits<double>::infinity());
  high.fill(-std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < points.count; ++i) {
    const Vec3d p = points[i];
    for (int a = 0; a < 3; ++a) {
      if (!std::isfinite(p[a]))
        return fail(ErrorCode::invalid_argument, label + ": point " + std::to_string(i) + " is not finite");
      sum[a] += p[a];
      low[a] = std::min(low[a], p[a]);
      high[a] = std::max(high[a], p[a]);
    }
  }
  if (low == high)
    return fail(ErrorCode::invalid_argument,
                label + ": all " + std::to_string(points.count) + " points are equal");
  for (double& s : sum) s /= static_cast<double>(points.count);
  return sum;
}

Result<void> check_attribute(const Vec3View& rows, std::size_t points, const std::string& label,
                             const char* what) {
  if (rows.count != points)
    return fail(ErrorCode::invalid_argument, label + ": the model reads " + what + "; the cloud has " +
                                                 std::to_string(rows.count) + " for " +
                                                 std::to_string(points) + " points");
  for (std::size_t i = 0; i < rows.count; ++i)
    for (double x : rows[i])
      if (!std::isfinite(x))
        return fail(ErrorCode::invalid_argument,
                    label + ": one of the " + what + ", " + std::to_string(i) + ", is not finite");
  return {};
}

}  // namespace

std::unique_ptr<Runner> make_runner(const Model& model, Mode mode, const PlanOptions& options, bool retain) {
  const graph::Graph whole = model::build_graph(model.weights(), mode);
  graph::Graph graph = options.as_defined ? model::expand(whole) : model::fold(whole);
  if (options.precision == Precision::f32)
    return std::make_unique<TypedRunner<float>>(std::move(graph), retain);
  return std::make_unique<TypedRunner<double>>(std::move(graph), retain);
}

RawPose Plan::Impl::raw_pose(std::size_t pair) const {
  const auto rows = runner->tensor(runner->graph().pose);
  const double* row = rows.data() + pair * ops::pose_width;
  RawPose raw;
  std::copy_n(row, 9, raw.T_reference_source.rotation.begin());
  std::copy_n(row + 9, 3, raw.T_reference_source.translation.begin());
  std::copy_n(row + 12, 3, raw.singular_values.begin());
  raw.determinant = row[15];
  return raw;
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

Result<PackedBatch> pack(const Plan::Impl& plan, std::span<const CloudPair> pairs) {
  const ModelConfig& config = plan.model.config();
  PackedBatch batch;
  std::vector<std::uint32_t> sizes;
  std::size_t total = 0;
  for (const CloudPair& pair : pairs) batch.clouds.push_back(&pair.source);
  for (const CloudPair& pair : pairs) batch.clouds.push_back(&pair.reference);
  const std::size_t least = static_cast<std::size_t>(std::max(config.k_neighbor + 1, config.key_mean_num));
  for (std::size_t c = 0; c < batch.clouds.size(); ++c) {
    const CloudView& cloud = *batch.clouds[c];
    const std::string label = cloud_label(c, pairs.size());
    if (cloud.positions.count < least)
      return fail(ErrorCode::invalid_argument, label + ": " + std::to_string(cloud.positions.count) +
                                                   " points, the model needs at least " +
                                                   std::to_string(least));
    total += cloud.positions.count;
    if (total > plan.capacity.points || pairs.size() > plan.capacity.pairs)
      return fail(ErrorCode::invalid_argument,
                  "the batch has " + std::to_string(pairs.size()) + " pairs and at least " +
                      std::to_string(total) + " points, the plan holds " +
                      std::to_string(plan.capacity.pairs) + " and " + std::to_string(plan.capacity.points));
    const auto centroid = check_positions(cloud.positions, label);
    if (!centroid) return tl::unexpected(centroid.error());
    if (config.return_normals)
      if (auto ok = check_attribute(cloud.normals, cloud.positions.count, label, "normals"); !ok)
        return tl::unexpected(ok.error());
    if (config.get_color)
      if (auto ok = check_attribute(cloud.colors, cloud.positions.count, label, "colours"); !ok)
        return tl::unexpected(ok.error());
    batch.centroids.push_back(*centroid);
    sizes.push_back(static_cast<std::uint32_t>(cloud.positions.count));
  }
  batch.layout = graph::BatchLayout(sizes, static_cast<std::uint32_t>(config.num_key_points));
  return batch;
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
  if (capacity.points > most || capacity.pairs > most)
    return fail(ErrorCode::invalid_argument, "the plan's capacity of " + std::to_string(capacity.points) +
                                                 " points exceeds " + std::to_string(most));
  const Mode mode = options.mode.value_or(model.mode());
  auto impl = std::unique_ptr<Plan::Impl>(
      new Plan::Impl{device, model, capacity, options, mode, make_runner(model, mode, options, false), {}});
  if (std::string fault = graph::check_executable(impl->runner->graph()); !fault.empty())
    return fail(ErrorCode::internal, fault);
  return Plan(std::move(impl));
}

}  // namespace bitr
