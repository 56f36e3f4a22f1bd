#include "train/run.hpp"

#include <bitr/io.hpp>
#include <chrono>
#include <cmath>

#include "api/internal.hpp"
#include "core/failure.hpp"
#include "core/guarded.hpp"
#include "data_sets/part.hpp"
#include "model/load.hpp"
#include "train/curves.hpp"
#include "train/metrics.hpp"
#include "train/trainer.hpp"
#include "train/validator.hpp"

namespace bitr::train {
namespace {

using Clock = std::chrono::steady_clock;
using Json = nlohmann::ordered_json;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

void write(const std::filesystem::path& path, std::span<const std::byte> bytes) {
  value_or_throw(io::write_file(path, bytes));
}

std::optional<Checkpoint> read_checkpoint(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return {};
  return value_or_throw(parse_checkpoint(value_or_throw(io::read_file(path)), path.string()));
}

void check_same_run(const TrainOptions& options, const Checkpoint& checkpoint, const std::string& file) {
  const auto differs = [&](const char* what) {
    throw Failure(ErrorCode::invalid_argument,
                  file + ": is of a run with another " + what + "; give its own, or another --out");
  };
  if (!(options.model == checkpoint.options.model)) differs("model configuration");
  if (options.mode != checkpoint.options.mode) differs("mode");
  if (options.seed != checkpoint.options.seed) differs("seed");
}

/// The shares of its points that a cloud of the part has: all of them where nothing is cropped.
std::pair<double, double> kept_shares(const DataPart& part) {
  if (!data::is_cropped(part)) return {1, 1};
  const double low = part.share_low, high = part.share_high;
  if (part.protocol == Protocol::complement) return {std::min(low, 1 - high), std::max(high, 1 - low)};
  return {low, high};
}

/// The loss's terms of the steps since the last line of metrics.
class Window {
 public:
  void add(const StepReport& report) {
    ++steps_;
    waited_ += report.waited;
    if (report.skipped) return;
    ++counted_;
    sum_.rotation += report.loss.rotation;
    sum_.translation += report.loss.translation;
    sum_.spread += report.loss.spread;
    norm_ += report.gradient_norm;
  }

  void write_to(Metrics& metrics, const Trainer& trainer, const StepReport& last) {
    const auto n = static_cast<double>(counted_);  // 0/0: no step of the window counted, null in the file
    const double seconds = seconds_since(start_);
    const TrainOptions& options = trainer.options();
    const auto pairs = static_cast<double>(steps_ * options.batch * options.accumulate);
    metrics.add({static_cast<std::size_t>(trainer.state().step), sum_.rotation / n, sum_.translation / n,
                 sum_.spread / n},
                {{"lr", last.lr},
                 {"gradient_norm", norm_ / n},
                 {"skipped_steps", trainer.state().skipped_steps},
                 {"skipped_samples", trainer.state().skipped_samples},
                 {"pairs_per_s", pairs / seconds},
                 {"waiting", waited_ / seconds},
                 {"seconds", trainer.state().seconds}});
    *this = Window();
  }

 private:
  LossTerms sum_;
  double norm_ = 0, waited_ = 0;
  std::size_t steps_ = 0, counted_ = 0;
  Clock::time_point start_ = Clock::now();
};

class Run {
 public:
  Run(const Device& device, const TrainOptions& options, const TrainFiles& files, Trainer& trainer)
      : options_(options), files_(files), trainer_(trainer), saved_step_(trainer.state().step) {
    if (options.validation.every > 0) validator_.emplace(device, options);
    metrics_.emplace(files.metrics(), static_cast<std::size_t>(trainer.state().step));
  }

  TrainEnd go(const TrainCallbacks& callbacks, Clock::time_point begin) {
    const TrainState& state = trainer_.state();
    if (state.step == 0) save();
    Clock::time_point lap = Clock::now();
    while (state.step < options_.steps) {
      if (options_.validation.patience > 0 && state.validations_since_best >= options_.validation.patience)
        return TrainEnd::early;
      const StepReport report = trainer_.step();
      measure(seconds_since(lap));
      window_.add(report);
      if (state.step % options_.log_every == 0) window_.write_to(*metrics_, trainer_, report);
      const auto validation = validate_if_due();
      if (validation || checkpoint_due()) save();

      const double seconds = seconds_since(lap);
      lap = Clock::now();
      trainer_.state().seconds += seconds;
      spent_ += seconds;
      if (callbacks.progress) callbacks.progress(progress(report, validation, seconds_since(begin)));
      if (options_.minutes > 0 && seconds_since(begin) >= 60 * options_.minutes) return TrainEnd::time_limit;
      if (callbacks.stop && callbacks.stop()) return TrainEnd::stopped;
    }
    return TrainEnd::finished;
  }

  /// The checkpoint, and the models as they are at it.
  void save() {
    const TrainState& state = trainer_.state();
    const std::vector<std::byte> model = serialize_model({});
    write(files_.checkpoint(), serialize(Checkpoint{options_, state}));
    write(files_.last(), model);
    if (!state.best_score) write(files_.model, model);
    saved_ = Clock::now();
    saved_step_ = state.step;
    models_saved_ = true;
  }

  /// False for a checkpoint from before this process: its models may not have been written.
  bool saved() const { return models_saved_ && saved_step_ == trainer_.state().step; }

 private:
  std::vector<std::byte> serialize_model(const std::optional<ValidationResult>& validation) const {
    model::Weights weights = trainer_.averaged();
    const DataOptions& data = options_.data;
    double low = 1, high = 0;
    for (const DataPart& part : data.parts) {
      const auto [least, most] = kept_shares(part);
      low = std::min(low, least);
      high = std::max(high, most);
    }
    const auto points = [](double share, std::size_t all) {
      return std::to_string(static_cast<std::size_t>(std::lround(share * static_cast<double>(all))));
    };
    weights.metadata["bitr.training"] = to_json(options_);
    weights.metadata["bitr.step"] = std::to_string(trainer_.state().step);
    weights.metadata["bitr.points_low"] = std::to_string(data.points_low);
    weights.metadata["bitr.points_high"] = std::to_string(data.points_high);
    weights.metadata["bitr.cloud_points_low"] = points(low, data.points_low);
    weights.metadata["bitr.cloud_points_high"] = points(high, data.points_high);
    if (validation) {
      Json medians = Json::object();
      for (const ValidationGroup& group : validation->groups)
        medians[group.name] = {{"rotation", group.errors.rotation.median},
                               {"translation", group.errors.translation.median}};
      weights.metadata["bitr.validation"] = medians.dump();
    }
    return bitr::serialize(Internal::model(std::make_shared<const model::Weights>(std::move(weights))));
  }

  std::optional<ValidationResult> validate_if_due() {
    TrainState& state = trainer_.state();
    if (!validator_ || (state.step % options_.validation.every != 0 && state.step != options_.steps))
      return {};
    ValidationResult result = validator_->run(trainer_.averaged(), static_cast<std::size_t>(state.step));
    result.best = !state.best_score || result.score < *state.best_score;
    ++state.validations_since_best;
    if (result.best) {
      state.best_score = result.score;
      state.best_step = state.step;
      state.validations_since_best = 0;
      write(files_.model, serialize_model(result));
    }
    metrics_->add(result, {{"seconds", state.seconds}});
    const std::string picture = curves_svg(metrics_->history(), files_.model.stem().string());
    write(files_.curves(), std::as_bytes(std::span(picture)));
    return result;
  }

  /// While no step succeeds there is nothing new to keep, and something old to go back to.
  bool checkpoint_due() const {
    const auto& [seconds, steps] = options_.checkpoint;
    const TrainState& state = trainer_.state();
    if (state.skipped_in_row > 0) return false;
    return (steps > 0 && state.step - saved_step_ >= steps) ||
           (seconds > 0 && seconds_since(saved_) >= seconds);
  }

  void measure(double seconds) {
    const double weight = std::max(1.0 / static_cast<double>(++measured_), 0.02);
    step_seconds_ += weight * (seconds - step_seconds_);
  }

  TrainProgress progress(const StepReport& report, const std::optional<ValidationResult>& validation,
                         double since_begin) const {
    const TrainState& state = trainer_.state();
    double remaining = spent_ / static_cast<double>(measured_) * static_cast<double>(options_.steps - state.step);
    if (options_.minutes > 0) remaining = std::min(remaining, std::max(60 * options_.minutes - since_begin, 0.0));
    return {.step = static_cast<std::size_t>(state.step),
            .steps = options_.steps,
            .loss = report.loss.total(),
            .rotation = report.loss.rotation,
            .translation = report.loss.translation,
            .spread = report.loss.spread,
            .lr = report.lr,
            .gradient_norm = report.gradient_norm,
            .skipped_steps = static_cast<std::size_t>(state.skipped_steps),
            .skipped_samples = static_cast<std::size_t>(state.skipped_samples),
            .pairs_per_second =
                static_cast<double>(options_.batch * options_.accumulate) / std::max(step_seconds_, 1e-9),
            .seconds_left = remaining,
            .validation = validation ? &*validation : nullptr};
  }

  const TrainOptions& options_;
  const TrainFiles& files_;
  Trainer& trainer_;
  std::optional<Metrics> metrics_;
  std::optional<Validator> validator_;
  Window window_;
  Clock::time_point saved_ = Clock::now();
  std::uint64_t saved_step_, measured_ = 0;
  bool models_saved_ = false;
  double step_seconds_ = 0;  // lately
  double spent_ = 0;         // by all steps here, with what came after them
};

}  // namespace

TrainSummary run(const Device& device, TrainOptions options, const TrainFiles& files, bool resume,
                 const TrainCallbacks& callbacks, const MakeDifferentiator& make) {
  const auto begin = Clock::now();
  const std::string file = files.checkpoint().string();
  auto checkpoint = read_checkpoint(files.checkpoint());
  if (checkpoint && !resume)
    throw Failure(ErrorCode::invalid_argument,
                  file + ": a run is there already: go on with it by --resume, or remove the file");
  std::error_code error;
  if (!checkpoint && std::filesystem::is_regular_file(files.model, error))
    throw Failure(ErrorCode::invalid_argument,
                  files.model.string() + ": a model is there already, and no checkpoint to go on from: " +
                      "remove it or give another name");
  model::Weights weights;
  if (checkpoint) {
    // The model that the run started from need not be there any more.
    options.init = checkpoint->options.init;
    if (!options.init.empty()) {
      options.model = checkpoint->options.model;
      options.mode = checkpoint->options.mode;
    }
    check_same_run(options, *checkpoint, file);
    weights = model::initial_weights(options.model, options.seed, options.mode);
  } else {
    weights = starting_weights(options);
    options.model = weights.config;
    options.mode = weights.mode;
  }
  weights.name = files.model.stem().string();
  options.data.normals = options.model.return_normals;

  const DataSet data = open_data(options, Split::train, options.data.parts, 0, options.seed);
  const unsigned threads = options.data_threads ? options.data_threads : std::max(1u, device.threads() / 2);
  std::optional<TrainState> state;
  if (checkpoint) {
    state = std::move(checkpoint->state);
    if (state->position.fingerprint != data.fingerprint())
      throw Failure(ErrorCode::invalid_argument,
                    file + ": is of a run with other data; give its own, or start another run with --init");
  }
  Trainer trainer(options, weights, make(weights), data, threads, std::move(state));
  const auto first_step = static_cast<std::size_t>(trainer.state().step);
  Run running(device, trainer.options(), files, trainer);
  const TrainEnd end = running.go(callbacks, begin);
  if (!running.saved()) running.save();

  const TrainState& last = trainer.state();
  return {.end = end,
          .step = static_cast<std::size_t>(last.step),
          .first_step = first_step,
          .skipped_steps = static_cast<std::size_t>(last.skipped_steps),
          .skipped_samples = static_cast<std::size_t>(last.skipped_samples),
          .skipped_shapes = data.skipped(),
          .best_score = last.best_score,
          .best_step = static_cast<std::size_t>(last.best_step),
          .seconds = seconds_since(begin)};
}

}  // namespace bitr::train
