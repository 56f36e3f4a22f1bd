#include "train/differentiator.hpp"

#include "api/pack.hpp"
#include "core/failure.hpp"
#include "cpu/executor.hpp"
#include "model/parameter_gradients.hpp"
#include "train/training_graph.hpp"

namespace bitr::train {
namespace {

PackedBatch packed(const ModelConfig& config, Precision precision, const std::vector<CloudPair>& pairs) {
  auto batch = pack(config, precision, shape_of(pairs), pairs);
  if (!batch) throw Failure(batch.error().code, batch.error().message);
  return std::move(*batch);
}

// Row-major R, then t, between the clouds' centroids.
std::array<double, ops::truth_width> truth_between(const Pose& pose, const Vec3d& source,
                                                   const Vec3d& reference) {
  std::array<double, ops::truth_width> truth;
  std::copy(pose.rotation.begin(), pose.rotation.end(), truth.begin());
  const Vec3d moved = pose.apply(source);
  for (int a = 0; a < 3; ++a) truth[9 + a] = moved[a] - reference[a];
  return truth;
}

template <class T>
class CpuDifferentiator : public Differentiator {
 public:
  CpuDifferentiator(Device device, const DifferentiatorOptions& options)
      : device_(std::move(device)), options_(options) {}

  LossTerms evaluate(const model::Weights& weights, std::span<const TrainingPair> pairs,
                     Gradients& gradients) override {
    std::vector<CloudPair> clouds;
    for (const TrainingPair& pair : pairs) clouds.push_back({pair.source, pair.reference});
    const PackedBatch batch = packed(weights.config, options_.precision, clouds);

    TrainingGraph training = training_graph(weights, options_.loss, options_.as_defined, for_each_);
    graph::Graph& graph = training.result.graph;
    if (executor_)
      executor_->replace(graph);
    else
      executor_.emplace(graph, false);
    executor_->prepare(batch.layout);
    for_each_input(batch, graph,
                   [&](graph::TensorId id, const Vec3View& rows, const Vec3d& shift, std::size_t row) {
                     copy_rows(rows, shift, 3, executor_->data(id) + 3 * row);
                   });
    T* truth = executor_->data(graph.truth);
    for (std::size_t i = 0; i < pairs.size(); ++i)
      for (const double value :
           truth_between(pairs[i].T_reference_source, batch.centroids[i], batch.centroids[i + pairs.size()]))
        *truth++ = static_cast<T>(value);
    executor_->run(device_.pool());

    std::vector<std::vector<double>> constants(training.made.nodes.size());
    for (std::size_t i = 0; i < constants.size(); ++i)
      if (const graph::TensorId id = training.result.constants[i]; id != graph::no_tensor)
        constants[i].assign(executor_->data(id), executor_->data(id) + graph.tensors[id].width);
    gradients = model::parameter_gradients(weights, training.whole, training.made, constants, for_each_);

    LossTerms terms;
    const T* loss = executor_->data(graph.loss);
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      terms.rotation += static_cast<double>(*loss++) / static_cast<double>(pairs.size());
      terms.translation += static_cast<double>(*loss++) / static_cast<double>(pairs.size());
      terms.spread += static_cast<double>(*loss++) / static_cast<double>(pairs.size());
    }
    return terms;
  }

 private:
  const Device device_;
  const DifferentiatorOptions options_;
  const ForEach for_each_ = [this](std::size_t count, const std::function<void(std::size_t)>& work) {
    device_.pool().parallel_for(count, 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) work(i);
    });
  };
  std::optional<cpu::Executor<T>> executor_;
};

}  // namespace

std::unique_ptr<Differentiator> make_differentiator(const Device& device, const model::Weights&,
                                                    const DifferentiatorOptions& options) {
  if (device.backend() != Backend::cpu)
    throw Failure(ErrorCode::unsupported, device.name() + ": training runs on the CPU backend only");
  if (options.precision == Precision::f32) return std::make_unique<CpuDifferentiator<float>>(device, options);
  return std::make_unique<CpuDifferentiator<double>>(device, options);
}

}  // namespace bitr::train
