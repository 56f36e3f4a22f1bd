#include "train/trainer.hpp"
#include "api/internal.hpp"

#include <gmock/gmock.h>

#include <bitr/device.hpp>
#include <bitr/io.hpp>
#include <cmath>

#include "bowl.hpp"
#include "train/flat.hpp"

namespace bitr::train {
namespace {

using test::Bowl;
using test::small_options;
using testing::HasSubstr;

struct Made {
  Bowl* bowl;
  Trainer trainer;
};

Made make(const TrainOptions& options, std::optional<TrainState> state = {}, unsigned threads = 1) {
  auto bowl = std::make_unique<Bowl>();
  Bowl* kept = bowl.get();
  const DataSet data = open_data(options, Split::train, options.data.parts, 0, options.seed);
  return {kept,
          Trainer(options, starting_weights(options), std::move(bowl), data, threads, std::move(state))};
}

ErrorCode code_of(const std::function<void()>& action, std::string* message = nullptr) {
  try {
    action();
  } catch (const Failure& failure) {
    if (message) *message = failure.what();
    return failure.error().code;
  }
  ADD_FAILURE() << "nothing was thrown";
  return ErrorCode::internal;
}

TEST(Flat, RowByRowAndBack) {
  const model::Weights weights = starting_weights(small_options());
  std::vector<double> flat = flatten(weights);
  ASSERT_EQ(flat.size(), flat_size(weights));
  std::size_t at = 0;
  for (const auto& [name, matrix] : weights.parameters)
    for (Eigen::Index i = 0; i < matrix.rows(); ++i)
      for (Eigen::Index j = 0; j < matrix.cols(); ++j) ASSERT_EQ(flat[at++], matrix(i, j)) << name;
  model::Weights copy = weights;
  for (double& x : flat) x += 1;
  unflatten(flat, copy);
  std::vector<double> sum(flat.size(), 0.5);
  Gradients gradients(copy.parameters.begin(), copy.parameters.end());
  add_gradients(weights, gradients, 2, sum);
  for (std::size_t i = 0; i < flat.size(); ++i) ASSERT_DOUBLE_EQ(sum[i], 0.5 + 2 * flat[i]);
  gradients.erase(gradients.begin());
  EXPECT_EQ(code_of([&] { add_gradients(weights, gradients, 1, sum); }), ErrorCode::internal);
}

/// Names of the parameters that `scale` changes at the start, each by that factor and nothing else.
std::vector<std::string> scaled_by(double TrainOptions::*scale, double factor) {
  TrainOptions options = small_options();
  options.*scale = factor;
  const model::Weights scaled = starting_weights(options);
  options.*scale = 1;
  const model::Weights plain = starting_weights(options);
  std::vector<std::string> names;
  for (const auto& [name, matrix] : plain.parameters) {
    if (matrix == scaled.parameters.at(name)) continue;
    names.push_back(name);
    EXPECT_EQ(Eigen::MatrixXd(factor * matrix), scaled.parameters.at(name)) << name;
  }
  return names;
}

TEST(Trainer, KeyLogitsAreScaledAtTheStart) {
  EXPECT_THAT(scaled_by(&TrainOptions::key_logit_scale, 6),
              testing::ElementsAre("feature_extract.key_layer.key_regress.project.1.transform.(0, 0)"));
}

TEST(Trainer, ExtractorsProjectionsAreScaledAtTheStart) {
  const auto names = scaled_by(&TrainOptions::feature_scale, 0.25);
  EXPECT_THAT(names, testing::Each(testing::StartsWith("feature_extract.Gblock.")));
  // Each layer has degrees 0 and 1.
  EXPECT_THAT(names, testing::SizeIs(2 * (small_options().model.feature_num_layers + 1)));
}

TEST(Trainer, StartsFromAWidenedModel) {
  TrainOptions options;
  options.init = "aircraft";
  const model::Weights narrow = starting_weights(options);
  const int channels = 2 * narrow.config.feature_num_channels;
  options.widen.feature_num_channels = channels;
  const model::Weights wide = starting_weights(options);
  EXPECT_EQ(wide.config.feature_num_channels, channels);
  EXPECT_EQ(wide.config.num_channels, narrow.config.num_channels);
  EXPECT_GT(flat_size(wide), flat_size(narrow));

  options.widen.feature_num_channels = 4;
  std::string message;
  EXPECT_EQ(code_of([&] { starting_weights(options); }, &message), ErrorCode::invalid_argument);
  EXPECT_THAT(message, HasSubstr("widen.feature_num_channels is 4, must be at least"));
}

// A seed that learnt nothing at the official scale.
TEST(Trainer, GradientsAtTheStartAreTame) {
  const Device device = cpu_device(2);
  for (const std::uint64_t seed : {1, 3, 5}) {
    TrainOptions options;
    options.seed = seed;
    options.model.centroid_offset = true;
    options.steps = 2;
    options.batch = 4;
    DataPart part;
    part.kind = "aircraft";
    options.data.parts = {part};
    const DataSet data = open_data(options, Split::train, options.data.parts, 0, seed);
    const model::Weights weights = starting_weights(options);
    Trainer trainer(options, weights, make_differentiator(device, weights), data, 1);
    EXPECT_LT(trainer.step().gradient_norm, 50) << seed;
  }
}

TEST(Trainer, GoesDownhill) {
  TrainOptions options = small_options();
  options.optimizer.lr = 0.02;
  options.steps = 200;
  Made made = make(options);
  const double first = made.trainer.step().loss.total();
  double last = 0;
  for (int i = 1; i < 200; ++i) last = made.trainer.step().loss.total();
  EXPECT_LT(last, 0.5 * first);
  EXPECT_EQ(made.trainer.state().step, 200u);
  EXPECT_EQ(made.trainer.state().adam.updates, 200u);
}

TEST(Trainer, ResumedRunIsTheSameBitForBit) {
  for (const std::size_t accumulate : {1, 3}) {
    TrainOptions options = small_options();
    options.accumulate = accumulate;
    Made straight = make(options, {}, 2);
    for (int i = 0; i < 20; ++i) straight.trainer.step();

    Made half = make(options, {}, 0);
    for (int i = 0; i < 10; ++i) half.trainer.step();
    const auto kept = parse_checkpoint(serialize(Checkpoint{options, half.trainer.state()}), "kept");
    ASSERT_TRUE(kept) << kept.error().message;
    Made resumed = make(kept->options, kept->state);
    for (int i = 0; i < 10; ++i) resumed.trainer.step();

    EXPECT_EQ(serialize(Checkpoint{options, resumed.trainer.state()}),
              serialize(Checkpoint{options, straight.trainer.state()}));
    EXPECT_NE(half.trainer.state().weights, straight.trainer.state().weights);
  }
}

TEST(Trainer, AccumulatesTheMeanOfItsBatches) {
  TrainOptions options = small_options();
  options.batch = 6;
  Made whole = make(options);
  options.batch = 2;
  options.accumulate = 3;
  Made parts = make(options);
  const double norm = whole.trainer.step().gradient_norm;
  EXPECT_NEAR(parts.trainer.step().gradient_norm, norm, 1e-9 * norm);
  EXPECT_EQ(parts.bowl->evaluations, 3);
  for (std::size_t i = 0; i < whole.trainer.state().weights.size(); ++i)
    ASSERT_NEAR(parts.trainer.state().weights[i], whole.trainer.state().weights[i], 1e-9);
}

TEST(Trainer, AveragesWhatItMakes) {
  Made made = make(small_options());
  const std::vector<double> before = made.trainer.state().weights;
  made.trainer.step();
  const TrainState& state = made.trainer.state();
  for (std::size_t i = 0; i < before.size(); ++i)
    ASSERT_NEAR(state.average[i], 0.1 * before[i] + 0.9 * state.weights[i], 1e-12);
  EXPECT_EQ(flatten(made.trainer.averaged()), state.average);
  EXPECT_TRUE(made.trainer.averaged().trained);
}

TEST(Trainer, SkipsStepsThatAreNotFinite) {
  Made made = make(small_options());
  made.bowl->poisoned = [](int n) { return n == 2 || n == 3; };
  made.trainer.step();
  const std::vector<double> good = made.trainer.state().weights, average = made.trainer.state().average;
  EXPECT_TRUE(made.trainer.step().skipped);
  EXPECT_TRUE(std::isnan(made.trainer.step().loss.rotation));
  EXPECT_EQ(made.trainer.state().weights, good);
  EXPECT_EQ(made.trainer.state().average, average);
  EXPECT_EQ(made.trainer.state().skipped_in_row, 2u);
  EXPECT_FALSE(made.trainer.step().skipped);
  EXPECT_EQ(made.trainer.state().skipped_steps, 2u);
  EXPECT_EQ(made.trainer.state().skipped_in_row, 0u);
  EXPECT_EQ(made.trainer.state().step, 4u);
  EXPECT_EQ(made.trainer.state().adam.updates, 2u);
}

TEST(Trainer, GivesUpAfterElevenSuchStepsInARow) {
  Made made = make(small_options());
  made.bowl->poisoned = [](int n) { return n > 1; };
  for (int i = 0; i < 11; ++i) made.trainer.step();
  std::string message;
  EXPECT_EQ(code_of([&] { made.trainer.step(); }, &message), ErrorCode::internal);
  EXPECT_THAT(message, HasSubstr("not finite in 11 steps in a row, up to step 12"));
}

TEST(Trainer, SkipsAndCountsWhatCannotBeUsed) {
  Made made = make(small_options());
  made.bowl->refused = [](int n) { return n == 1; };
  made.trainer.step();
  EXPECT_EQ(made.trainer.state().skipped_samples, 2u);
  made.bowl->refused = [](int) { return true; };
  EXPECT_EQ(code_of([&] { made.trainer.step(); }), ErrorCode::invalid_argument);
}

TEST(Trainer, SkipsCloudsThatAreTooSmall) {
  TrainOptions options = small_options();
  options.data.points_low = 6;  // the model needs 9
  options.data.points_high = 12;
  Made made = make(options);
  for (int i = 0; i < 5; ++i) made.trainer.step();
  EXPECT_GT(made.trainer.state().skipped_samples, 0u);

  options.data.points_high = 8;
  Made hopeless = make(options);
  std::string message;
  EXPECT_EQ(code_of([&] { hopeless.trainer.step(); }, &message), ErrorCode::bad_file);
  EXPECT_THAT(message, HasSubstr("11 samples in a row cannot be used; the last: "));
  EXPECT_THAT(message, HasSubstr("points, the model needs at least 9"));
}

TEST(Trainer, RefusesAStateOfAnotherModelOrOtherData) {
  TrainOptions options = small_options();
  const TrainState state = make(options).trainer.state();
  TrainOptions other = options;
  other.model.feature_num_channels = 8;
  EXPECT_EQ(code_of([&] { make(other, state); }), ErrorCode::invalid_argument);
  other = options;
  other.data.noise = 0.5;
  std::string message;
  EXPECT_EQ(code_of([&] { make(other, state); }, &message), ErrorCode::invalid_argument);
  EXPECT_THAT(message, HasSubstr("another data set"));
}

TEST(Checkpoint, RefusesWhatIsDamaged) {
  const TrainOptions options = small_options();
  Made made = make(options);
  made.trainer.step();
  const std::vector<std::byte> bytes = serialize(Checkpoint{options, made.trainer.state()});
  ASSERT_TRUE(parse_checkpoint(bytes, "kept"));
  for (const std::size_t size : {std::size_t{0}, std::size_t{7}, bytes.size() / 2, bytes.size() - 1}) {
    const auto cut = parse_checkpoint(std::span(bytes).first(size), "kept");
    ASSERT_FALSE(cut) << size;
    EXPECT_EQ(cut.error().code, ErrorCode::bad_file);
    EXPECT_THAT(cut.error().message, HasSubstr("kept: "));
  }
  const auto model = serialize(Internal::model(std::make_shared<model::Weights>(made.trainer.averaged())));
  const auto wrong = parse_checkpoint(model, "kept");
  ASSERT_FALSE(wrong);
  EXPECT_THAT(wrong.error().message, HasSubstr("this is no checkpoint"));
}

}  // namespace
}  // namespace bitr::train
