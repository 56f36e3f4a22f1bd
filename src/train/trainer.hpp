// One training step after the other, in memory: samples, their loss's gradient, an update.
#pragma once

#include <memory>

#include "train/checkpoint.hpp"
#include "train/differentiator.hpp"

namespace bitr::train {

/// More steps in a row than this without a finite gradient end a run, samples that cannot be used a batch.
inline constexpr std::uint64_t most_skipped = 10;

/// The untrained weights that a run starts from.
model::Weights starting_weights(const TrainOptions& options);

/// The shapes to train on, or those to validate on: `parts` with `samples` samples of an epoch.
DataSet open_data(const TrainOptions& options, Split split, const std::vector<DataPart>& parts,
                  std::size_t samples, std::uint64_t seed);

struct StepReport {
  LossTerms loss;  ///< NaN when the step was skipped
  double lr = 0, gradient_norm = 0;
  bool skipped = false;
  double waited = 0;  ///< seconds for samples
};

class Trainer {
 public:
  /// Goes on from `state` if there is one. `weights` give names, shapes and, without a state, values.
  /// Failure when the state does not fit the weights or the data.
  Trainer(const TrainOptions& options, model::Weights weights, std::unique_ptr<Differentiator> differentiator,
          const DataSet& data, unsigned data_threads, std::optional<TrainState> state = {});

  /// Failure: `internal` after too many skipped steps in a row, `bad_file` after too many samples that
  /// cannot be used, and what the differentiator throws otherwise.
  StepReport step();

  const TrainState& state() const { return state_; }
  TrainState& state() { return state_; }
  const TrainOptions& options() const { return options_; }
  const DataSet& data() const { return data_; }
  /// The model with its averaged weights.
  model::Weights averaged() const;

 private:
  void draw(std::vector<DataSample>& batch);
  LossTerms evaluate(std::span<double> gradient, double& waited);

  TrainOptions options_;
  model::Weights weights_;
  std::unique_ptr<Differentiator> differentiator_;
  DataSet data_;
  std::optional<Sampler> sampler_;
  TrainState state_;
  std::vector<double> gradient_;
  Gradients gradients_;
};

}  // namespace bitr::train
