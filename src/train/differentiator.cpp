#include "train/differentiator.hpp"

#include "api/pack.hpp"
#include "core/failure.hpp"
#include "core/guarded.hpp"
#include "cpu/executor.hpp"
#include "model/parameter_gradients.hpp"
#include "train/training_graph.hpp"
#include "train/vulkan_steps.hpp"

namespace bitr::train {
namespace {

// Between the clouds' centroids.
Truth truth_of(const TrainingPair& pair, const Vec3d& source, const Vec3d& reference) {
  Truth truth{};
  auto to = std::copy(pair.T_reference_source.rotation.begin(), pair.T_reference_source.rotation.end(),
                      truth.begin());
  const Vec3d moved = pair.T_reference_source.apply(source);
  for (int a = 0; a < 3; ++a) *to++ = moved[a] - reference[a];
  to = std::ranges::copy(pair.T_source_object.rotate(pair.symmetry.axis), to).out;
  for (int a = 0; a < 3; ++a) *to++ = pair.T_source_object.translation[a] - source[a];
  *to = pair.symmetry.order == 0 ? 0 : 2 * std::numbers::pi / pair.symmetry.order;
  return truth;
}

// Training graphs on the CPU; as VulkanSteps.
template <class T>
class CpuSteps {
 public:
  explicit CpuSteps(const Device& device) : pool_(device.pool()) {}

  void run(graph::Graph graph, const PackedBatch& batch, std::span<const Truth> truths) {
    if (executor_)
      executor_->replace(std::move(graph));
    else
      executor_.emplace(std::move(graph), false);
    executor_->prepare(batch.layout);
    fill_inputs(batch, executor_->graph(), 3, [&](graph::TensorId id) { return executor_->data(id); });
    T* to = executor_->data(executor_->graph().input(graph::Input::truth));
    for (const Truth& truth : truths)
      to = std::transform(truth.begin(), truth.end(), to, [](double x) { return static_cast<T>(x); });
    executor_->run(pool_);
  }
  std::vector<double> numbers(graph::TensorId id) const {
    const graph::TensorInfo& info = executor_->graph().tensors[id];
    const T* from = executor_->data(id);
    return {from, from + executor_->layout().rows(info.rows) * info.per_row * info.width};
  }

 private:
  ThreadPool& pool_;
  std::optional<cpu::Executor<T>> executor_;
};

template <class Steps>
class GraphDifferentiator : public Differentiator {
 public:
  GraphDifferentiator(Device device, const DifferentiatorOptions& options)
      : device_(std::move(device)), options_(options), steps_(device_) {}

  LossTerms evaluate(const model::Weights& weights, std::span<const TrainingPair> pairs,
                     Gradients& gradients) override {
    std::vector<CloudPair> clouds;
    for (const TrainingPair& pair : pairs) clouds.push_back({pair.source, pair.reference});
    const PackedBatch batch =
        value_or_throw(pack(weights.config, options_.precision, shape_of(clouds), clouds));
    std::vector<Truth> truths;
    for (std::size_t i = 0; i < pairs.size(); ++i)
      truths.push_back(truth_of(pairs[i], batch.centroids[i], batch.centroids[i + pairs.size()]));

    TrainingGraph training = training_graph(weights, options_.loss, options_.as_defined, for_each_);
    steps_.run(std::move(training.result.graph), batch, truths);
    std::vector<std::vector<double>> constants(training.made.nodes.size());
    for (std::size_t i = 0; i < constants.size(); ++i)
      if (const graph::TensorId id = training.result.constants[i]; id != graph::no_tensor)
        constants[i] = steps_.numbers(id);
    gradients = model::parameter_gradients(weights, training.whole, training.made, constants, for_each_);

    std::array<double, ops::loss_terms> means{};
    const std::vector<double> loss = steps_.numbers(training.made.output(graph::Output::loss));
    for (std::size_t i = 0; i < loss.size(); ++i)
      means[i % means.size()] += loss[i] / static_cast<double>(pairs.size());
    return {.rotation = means[0], .translation = means[1], .spread = means[2]};
  }

 private:
  const Device device_;
  const DifferentiatorOptions options_;
  const ForEach for_each_ = [this](std::size_t count, const std::function<void(std::size_t)>& work) {
    device_.pool().parallel_for(count, 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) work(i);
    });
  };
  Steps steps_;
};

}  // namespace

std::unique_ptr<Differentiator> make_differentiator(const Device& device, const model::Weights&,
                                                    const DifferentiatorOptions& options) {
  const bool vulkan = device.backend() == Backend::vulkan;
  const auto refuse = [&](const char* what) {
    throw Failure(ErrorCode::unsupported,
                  std::string(what) + " runs on the CPU only, not on " + device.name() + " through Vulkan");
  };
  if (vulkan && options.precision == Precision::f64) refuse("training in precision f64");
  if (vulkan && options.as_defined) refuse("training of the network as defined, unfolded,");
  if (vulkan) return std::make_unique<GraphDifferentiator<VulkanSteps>>(device, options);
  if (options.precision == Precision::f32)
    return std::make_unique<GraphDifferentiator<CpuSteps<float>>>(device, options);
  return std::make_unique<GraphDifferentiator<CpuSteps<double>>>(device, options);
}

}  // namespace bitr::train
