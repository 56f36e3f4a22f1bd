// Whole training steps: samples drawn beside, forward and backward, the update.
#include <bitr/train.hpp>

#include "bench.hpp"
#include "train/trainer.hpp"

namespace bitr::bench {
namespace {

// Whole shapes, so that every cloud has the same number of points.
TrainOptions options_of(Size size) {
  TrainOptions options;
  options.batch = size.pairs;
  DataPart part;
  part.kind = "aircraft";
  part.share_low = part.share_high = 1;
  options.data.parts = {part};
  options.data.points_low = options.data.points_high = size.points;
  return options;
}

void measure(benchmark::State& state, const Device& device, Size size) {
  const TrainOptions options = options_of(size);
  const DataSet data = train::open_data(options, Split::train, options.data.parts, 0, options.seed);
  const model::Weights weights = train::starting_weights(options);
  train::Trainer trainer(options, weights, train::make_differentiator(device, weights), data, 1);
  trainer.step();
  double waited = 0;
  for (auto _ : state) waited += trainer.step().waited;
  state.SetItemsProcessed(state.iterations() * size.pairs);
  state.counters["waited_ms"] = benchmark::Counter(1000 * waited, benchmark::Counter::kAvgIterations);
}

}  // namespace

void register_training(const Run& run) {
  if (run.counters) return;
  for (const Size size : {Size{512, 8}, Size{1024, 8}})
    register_whole(run, "training/" + size.str(),
                   [=](benchmark::State& state, const Device& device) { measure(state, device, size); });
}

}  // namespace bitr::bench
