// Training: a model from pairs of clouds whose motion is known. A run is a configuration, the files it writes
// and a device; it can be stopped at any moment and goes on from its last checkpoint.
#pragma once

#include <bitr/data.hpp>
#include <bitr/device.hpp>
#include <bitr/evaluate.hpp>
#include <bitr/model.hpp>
#include <bitr/result.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace bitr {

enum class TrainLoss : std::uint8_t {
  official,  ///< the paper's, through the projection onto rotations
  direct,    ///< on the head's numbers as they are, nothing projected: the one that learns
  robust,    ///< the same with the rotation's error not squared: rules medians, where `direct` rules means
};

/// Adam, after the gradient's entries and then its norm have been limited.
struct OptimizerOptions {
  double lr = 1.5e-3;  ///< at the schedule's height, 0 … 1
  double beta1 = 0.9, beta2 = 0.999, eps = 1e-8;
  double clip_value = 0;  ///< entries are limited to ± this; 0: they are not (the official code: 1)
  double clip_norm = 1;   ///< the whole gradient is scaled down to this length; 0: it is not
};

/// The learning rate over the steps, in shares of OptimizerOptions::lr: up along a line, then down along half
/// a cosine that ends at the last step.
struct ScheduleOptions {
  std::size_t warmup = 50;  ///< steps
  double floor = 0.01;      ///< 0 … 1
};

/// How the trainer tells whether the model gets better: on samples of shapes that it does not train on, the
/// same each time, with the averaged weights.
struct ValidationOptions {
  std::size_t every = 500;   ///< steps; 0: never
  std::size_t samples = 64;  ///< from each part
  std::uint64_t seed = 1;
  std::vector<DataPart> parts = {};  ///< those of the training data if there are none; of files that are
                                     ///< not trained on, all are used
  std::size_t patience = 0;          ///< stop after so many in a row that were no better; 0: do not
};

struct CheckpointOptions {
  double seconds = 60;    ///< at the first step after so long; 0: not by time
  std::size_t steps = 0;  ///< every so many; 0: not by steps
};

/// Channels that a run adds to the model it starts from, which says the same at first: more to learn with,
/// nothing unlearnt. 0: as many as that model has.
struct WidenOptions {
  int num_channels = 0, feature_num_channels = 0, predict_head = 0;  ///< ModelConfig's, from then on
};

/// Fewer shapes than these are not divided unless it is asked for.
inline constexpr std::size_t least_divided_shapes = 10;

/// How shapes are held back for validation.
enum class ShapeSplit : std::uint8_t {
  automatic,  ///< `shapes`, or `none` where there are fewer than least_divided_shapes
  shapes,     ///< by Split::train and Split::validation
  none,       ///< validation has other crops of the same shapes
};

struct TrainOptions {
  ModelConfig model = trainable_config();
  Mode mode = Mode::scale_exact;
  std::uint64_t seed = 0;  ///< for the initial weights and for the order and crops of the data
  /// A model to start from instead; then `model` and `mode` are that file's.
  std::filesystem::path init = {};
  WidenOptions widen = {};  ///< with `init` only
  /// The key points' logits are larger by this at the start: they spread instead of meeting at the centroid.
  /// For weights that `init` does not give.
  double key_logit_scale = 6;
  /// The projections that end the extractor's layers are this times as large at the start. Features that grow
  /// from layer to layer saturate its attention: gradients of 1e3 … 1e7, and most seeds learn nothing.
  /// For weights that `init` does not give; 1: the official initialisation.
  double feature_scale = 0.3;
  TrainLoss loss = TrainLoss::direct;
  std::size_t steps = 20'000;
  std::size_t batch = 8;       ///< pairs of one evaluation
  std::size_t accumulate = 1;  ///< evaluations of one step
  OptimizerOptions optimizer = {};
  ScheduleOptions schedule = {};
  double ema_decay = 0.999;  ///< the averaged weights' decay: min(this, (1 + n)/(10 + n)) at update n
  /// `split`, `normals`, `samples` and `seed` are the trainer's to set.
  DataOptions data = train_data();
  ShapeSplit split = ShapeSplit::automatic;
  ValidationOptions validation = {};
  CheckpointOptions checkpoint = {};
  double minutes = 0;          ///< stop cleanly after so long, in this process; 0: do not
  std::size_t log_every = 10;  ///< steps from one line of metrics to the next
  unsigned data_threads = 0;   ///< that draw samples; 0: half of the device's threads

  /// Normals, a dilation of 4 and the ReLU over |d|²: what learns best of the model's options.
  static ModelConfig trainable_config();
  /// Without parts; 512 … 2048 points of the whole object, noise 0.01.
  static DataOptions train_data();
};

/// A setting that replaces the configuration file's: the path to its value ("optimizer.lr",
/// "data.parts.0.share"), the value as JSON, and what to call it in errors ("--set optimizer.lr=1").
struct TrainOverride {
  std::string key, value, label;
};

/// From JSON with comments; what is missing keeps its default. `invalid_argument` names `file` or the
/// override, the key, the value and the limit; `bad_file` when it is not JSON.
Result<TrainOptions> parse_train_options(std::string_view json, const std::string& file,
                                         std::span<const TrainOverride> overrides = {});
/// Every setting, in the form that parse_train_options reads.
std::string to_json(const TrainOptions& options);

/// What a run writes. All names begin with the model's, without its extension.
struct TrainFiles {
  std::filesystem::path model;         ///< NAME.safetensors: best of the validations; the last without any
  std::filesystem::path last() const;  ///< NAME.last.safetensors: averaged weights at the last checkpoint
  std::filesystem::path checkpoint() const;  ///< NAME.checkpoint
  std::filesystem::path metrics() const;     ///< NAME.metrics.jsonl
  std::filesystem::path curves() const;      ///< NAME.curves.svg
};

/// Errors on one part of the validation data.
struct ValidationGroup {
  std::string name;  ///< "aircraft opposed 0.3-0.7"
  ErrorSummary errors;
};

struct ValidationResult {
  std::size_t step = 0;
  std::vector<ValidationGroup> groups;
  double score = 0;  ///< mean over the groups of the median Δr, in degrees: what the best is best in
  bool best = false;
};

struct TrainProgress {
  std::size_t step = 0, steps = 0;
  double loss = 0, rotation = 0, translation = 0, spread = 0;  ///< the last step's; NaN if it was skipped
  double lr = 0, gradient_norm = 0;                            ///< before it was limited
  std::size_t skipped_steps = 0;    ///< whose gradient was not finite, since the run's beginning
  std::size_t skipped_samples = 0;  ///< that could not be drawn or used, since the run's beginning
  double pairs_per_second = 0;      ///< lately, waiting for data included
  double seconds_left = 0;          ///< to the last step or the time limit, as it went so far
  const ValidationResult* validation = nullptr;  ///< the one just made, if any
};

struct TrainCallbacks {
  std::function<void(const TrainProgress&)> progress = {};  ///< after every step
  std::function<bool()> stop = {};  ///< asked after every step: true stops with a checkpoint
};

enum class TrainEnd : std::uint8_t { finished, early, time_limit, stopped };

struct TrainSummary {
  TrainEnd end = TrainEnd::finished;
  std::size_t step = 0, first_step = 0;  ///< where it is, where this process began
  std::size_t skipped_steps = 0, skipped_samples = 0;
  std::vector<SkippedShape> skipped_shapes;  ///< found out by this process
  std::optional<double> best_score;
  std::size_t best_step = 0;
  double seconds = 0;  ///< spent by this process
};

/// Trains. With `resume` it goes on from the checkpoint if there is one; on the same backend the weights are
/// then, bit for bit, those of a run that was never interrupted. The model and the data must be the
/// checkpoint's, everything else may differ. Files are written whole or not at all; they are the last
/// checkpoint's when an error comes back. Errors: `invalid_argument` for options out of range, data that
/// cannot be opened, a checkpoint of another run, or one that is there without `resume`; `io` when a file
/// cannot be read or written; `internal` after more than 10 steps in a row whose gradient was not finite;
/// `device_lost`.
Result<TrainSummary> train_model(const Device& device, const TrainOptions& options, const TrainFiles& files,
                                 bool resume = false, const TrainCallbacks& callbacks = {});

/// The options of the run that a checkpoint belongs to. `io`, `bad_file`.
Result<TrainOptions> checkpoint_options(const std::filesystem::path& checkpoint);

}  // namespace bitr
