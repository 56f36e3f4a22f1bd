#include "train/differentiator.hpp"

#include "api/executor.hpp"
#include "api/internal.hpp"
#include "api/pack.hpp"
#include "core/failure.hpp"
#include "core/guarded.hpp"
#include "core/thread_pool.hpp"
#include "model/parameter_gradients.hpp"
#include "train/training_graph.hpp"

namespace bitr::train {
namespace {

// A row of ops/loss.hpp's true poses, between the clouds' centroids.
void add_truth(const TrainingPair& pair, const Vec3d& source, const Vec3d& reference,
               std::vector<double>& rows) {
  rows.resize(rows.size() + ops::truth_width);
  auto to = std::copy(pair.T_reference_source.rotation.begin(), pair.T_reference_source.rotation.end(),
                      rows.end() - ops::truth_width);
  const Vec3d moved = pair.T_reference_source.apply(source);
  for (int a = 0; a < 3; ++a) *to++ = moved[a] - reference[a];
  to = std::ranges::copy(pair.T_source_object.rotate(pair.symmetry.axis), to).out;
  for (int a = 0; a < 3; ++a) *to++ = pair.T_source_object.translation[a] - source[a];
  *to = pair.symmetry.order == 0 ? 0 : 2 * std::numbers::pi / pair.symmetry.order;
}

class GraphDifferentiator : public Differentiator {
 public:
  GraphDifferentiator(Device device, const DifferentiatorOptions& options)
      : device_(std::move(device)), options_(options) {}

  LossTerms evaluate(const model::Weights& weights, std::span<const TrainingPair> pairs,
                     Gradients& gradients) override {
    std::vector<CloudPair> clouds;
    for (const TrainingPair& pair : pairs) clouds.push_back({pair.source, pair.reference});
    const PackedBatch batch =
        value_or_throw(pack(weights.config, options_.precision, shape_of(clouds), clouds));
    std::vector<double> truths;
    for (std::size_t i = 0; i < pairs.size(); ++i)
      add_truth(pairs[i], batch.centroids[i], batch.centroids[i + pairs.size()], truths);

    TrainingGraph training = training_graph(weights, options_.loss, options_.as_defined, for_each_);
    run(std::move(training.result.graph), batch, truths);
    std::vector<std::vector<double>> constants(training.made.nodes.size());
    for (std::size_t i = 0; i < constants.size(); ++i)
      if (const graph::TensorId id = training.result.constants[i]; id != graph::no_tensor)
        constants[i] = executor_->read<double>(id);
    gradients = model::parameter_gradients(weights, training.whole, training.made, constants, for_each_);

    std::array<double, ops::loss_terms> means{};
    const std::vector<double> loss = executor_->read<double>(graph::Output::loss);
    for (std::size_t i = 0; i < loss.size(); ++i)
      means[i % means.size()] += loss[i] / static_cast<double>(pairs.size());
    return {.rotation = means[0], .translation = means[1], .spread = means[2]};
  }

 private:
  // From step to step the graph has other constants.
  void run(graph::Graph graph, const PackedBatch& batch, const std::vector<double>& truths) {
    // Batches of points that vary a little should not have to grow it again and again.
    constexpr double growth = 9.0 / 8;
    if (executor_)
      executor_->replace(std::move(graph));
    else
      executor_ = make_executor(device_, std::move(graph), batch.layout,
                                {.precision = options_.precision, .growth = growth});
    executor_->prepare(batch.layout);
    fill_inputs(batch, *executor_);
    executor_->write(graph::Input::truth, truths);
    executor_->run();
  }

  const Device device_;
  const DifferentiatorOptions options_;
  const ForEach for_each_ = [this](std::size_t count, const std::function<void(std::size_t)>& work) {
    Internal::pool(device_).parallel_for(count, 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) work(i);
    });
  };
  std::unique_ptr<graph::Executor> executor_;
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
  return std::make_unique<GraphDifferentiator>(device, options);
}

}  // namespace bitr::train
