#include "train/trainer.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "api/internal.hpp"
#include "api/plan.hpp"
#include "core/failure.hpp"
#include "core/guarded.hpp"
#include "model/load.hpp"
#include "model/widen.hpp"
#include "train/flat.hpp"
#include "train/schedule.hpp"

namespace bitr::train {
namespace {

using Clock = std::chrono::steady_clock;

constexpr const char* key_logits = "feature_extract.key_layer.key_regress.project.1.transform.(0, 0)";

bool ends_extractor_layer(const std::string& name) {
  return name.starts_with("feature_extract.Gblock.") && name.find(".project.") != std::string::npos;
}

model::Weights fresh_weights(const TrainOptions& options, const ModelConfig& config, Mode mode) {
  value_or_throw(validate(config), "model: ");
  model::Weights weights = model::initial_weights(config, options.seed, mode);
  weights.parameters.at(key_logits) *= options.key_logit_scale;
  for (auto& [name, matrix] : weights.parameters)
    if (ends_extractor_layer(name)) matrix *= options.feature_scale;
  return weights;
}

// Files that are only validated on are not divided.
bool own_files(const TrainOptions& options, const std::vector<DataPart>& parts) {
  return std::none_of(parts.begin(), parts.end(), [&](const DataPart& part) {
    return !part.kind.empty() ||
           std::any_of(options.data.parts.begin(), options.data.parts.end(),
                       [&](const DataPart& other) { return other.folder == part.folder; });
  });
}

Split split_of(const TrainOptions& options, Split wanted, const DataOptions& data) {
  if (wanted == Split::validation && own_files(options, data.parts)) return Split::all;
  if (options.split == ShapeSplit::none) return Split::all;
  if (options.split == ShapeSplit::shapes) return wanted;
  DataOptions all = data;
  all.parts = options.data.parts;
  all.split = Split::all;
  return value_or_throw(DataSet::open(all)).shapes() < least_divided_shapes ? Split::all : wanted;
}

// Why a pair cannot be used; empty if it can.
std::string unusable(const DataSample& sample, std::size_t least) {
  const std::size_t points = std::min(sample.source.size(), sample.reference.size());
  if (points >= least) return {};
  return sample.shape + ": a cloud has " + std::to_string(points) + " points, the model needs at least " +
         std::to_string(least);
}

}  // namespace

model::Weights starting_weights(const TrainOptions& options) {
  if (options.init.empty()) return fresh_weights(options, options.model, options.mode);
  model::Weights weights = Internal::weights(value_or_throw(find_model(options.init.string())));
  weights.metadata.clear();
  ModelConfig config = weights.config;
  const auto widen = [](int wider, int& channels) {
    if (wider > 0) channels = wider;
  };
  widen(options.widen.num_channels, config.num_channels);
  widen(options.widen.feature_num_channels, config.feature_num_channels);
  widen(options.widen.predict_head, config.predict_head);
  if (config == weights.config) return weights;
  return value_or_throw(model::widen(weights, fresh_weights(options, config, weights.mode)), "widen.");
}

DataSet open_data(const TrainOptions& options, Split split, const std::vector<DataPart>& parts,
                  std::size_t samples, std::uint64_t seed) {
  DataOptions data = options.data;
  data.parts = parts;
  data.samples = samples;
  data.seed = seed;
  data.normals = options.model.return_normals;
  data.split = split_of(options, split, data);
  return value_or_throw(DataSet::open(data));
}

Trainer::Trainer(const TrainOptions& options, model::Weights weights,
                 std::unique_ptr<Differentiator> differentiator, const DataSet& data, unsigned data_threads,
                 std::optional<TrainState> state)
    : options_(options),
      weights_(std::move(weights)),
      differentiator_(std::move(differentiator)),
      data_(data) {
  if (state) {
    state_ = std::move(*state);
    if (state_.weights.size() != flat_size(weights_))
      throw Failure(ErrorCode::invalid_argument,
                    "the checkpoint has " + std::to_string(state_.weights.size()) +
                        " weights, the configured model " + std::to_string(flat_size(weights_)));
    unflatten(state_.weights, weights_);
  } else {
    state_.weights = flatten(weights_);
    state_.average = state_.weights;
    state_.adam.first.resize(state_.weights.size());
    state_.adam.second.resize(state_.weights.size());
  }
  sampler_ = value_or_throw(Sampler::start(data_, {.threads = data_threads,
                                                   .ahead = 2 * options_.batch * options_.accumulate,
                                                   .start = state_.position}));
  state_.position = sampler_->position();
}

model::Weights Trainer::averaged() const {
  model::Weights weights = weights_;
  unflatten(state_.average, weights);
  weights.trained = true;
  return weights;
}

void Trainer::draw(std::vector<DataSample>& batch) {
  const std::size_t least = least_points(weights_.config);
  std::uint64_t in_row = 0;
  batch.clear();
  while (batch.size() < options_.batch) {
    auto sample = sampler_->next();
    const std::string why = sample ? unusable(*sample, least) : sample.error().message;
    if (why.empty()) {
      batch.push_back(std::move(*sample));
      in_row = 0;
      continue;
    }
    ++state_.skipped_samples;
    if (++in_row > most_skipped)
      throw Failure(ErrorCode::bad_file,
                    std::to_string(in_row) + " samples in a row cannot be used; the last: " + why);
  }
}

LossTerms Trainer::evaluate(std::span<double> gradient, double& waited) {
  std::vector<DataSample> batch;
  std::vector<TrainingPair> pairs;
  for (std::uint64_t attempt = 0;; ++attempt) {
    const auto start = Clock::now();
    draw(batch);
    waited += std::chrono::duration<double>(Clock::now() - start).count();
    pairs.clear();
    for (const DataSample& sample : batch)
      pairs.push_back({sample.source, sample.reference, sample.T_reference_source, sample.T_source_object,
                       sample.symmetry});
    try {
      const LossTerms loss = differentiator_->evaluate(weights_, pairs, gradients_);
      add_gradients(weights_, gradients_, 1.0 / static_cast<double>(options_.accumulate), gradient);
      return loss;
    } catch (const Failure& failure) {
      if (failure.error().code != ErrorCode::invalid_argument || attempt >= most_skipped) throw;
      state_.skipped_samples += batch.size();
    }
  }
}

StepReport Trainer::step() {
  StepReport report;
  gradient_.assign(state_.weights.size(), 0);
  for (std::size_t i = 0; i < options_.accumulate; ++i) {
    const LossTerms loss = evaluate(gradient_, report.waited);
    const double share = 1.0 / static_cast<double>(options_.accumulate);
    report.loss.rotation += share * loss.rotation;
    report.loss.translation += share * loss.translation;
    report.loss.spread += share * loss.spread;
  }
  report.lr = learning_rate(options_, state_.step);
  report.gradient_norm = limit_gradient(gradient_, options_.optimizer);
  ++state_.step;
  state_.position = sampler_->position();
  if (!std::isfinite(report.gradient_norm) || !std::isfinite(report.loss.total())) {
    report.loss.rotation = report.loss.translation = report.loss.spread =
        std::numeric_limits<double>::quiet_NaN();
    report.skipped = true;
    ++state_.skipped_steps;
    if (++state_.skipped_in_row > most_skipped)
      throw Failure(ErrorCode::internal,
                    "the gradient was not finite in " + std::to_string(state_.skipped_in_row) +
                        " steps in a row, up to step " + std::to_string(state_.step) +
                        "; the weights are those of the last checkpoint: go on with a smaller optimizer.lr");
    return report;
  }
  state_.skipped_in_row = 0;
  adam(state_.weights, gradient_, state_.adam, report.lr, options_.optimizer);
  average(state_.average, state_.weights, average_decay(options_.ema_decay, state_.adam.updates - 1));
  unflatten(state_.weights, weights_);
  return report;
}

}  // namespace bitr::train
