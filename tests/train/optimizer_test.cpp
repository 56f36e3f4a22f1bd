#include "train/optimizer.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "train/schedule.hpp"

namespace bitr::train {
namespace {

using testing::DoubleNear;
using testing::ElementsAre;

TEST(Adam, FollowsASequenceWorkedOutByHand) {
  const OptimizerOptions options{.beta1 = 0.9, .beta2 = 0.99, .eps = 1e-2};
  std::vector<double> weights = {1};
  AdamState state;

  // m = 0.2, v = 0.04; corrected 2 and 4: 1 − 0.1 · 2/(2 + 0.01)
  adam(weights, std::vector<double>{2}, state, 0.1, options);
  EXPECT_NEAR(weights[0], 1 - 0.2 / 2.01, 1e-15);
  EXPECT_EQ(state.updates, 1u);

  // m = 0.18 − 0.1 = 0.08, v = 0.0396 + 0.01 = 0.0496; corrected 0.08/0.19 and 0.0496/0.0199
  adam(weights, std::vector<double>{-1}, state, 0.1, options);
  EXPECT_NEAR(weights[0], 1 - 0.2 / 2.01 - 0.1 * (0.08 / 0.19) / (std::sqrt(0.0496 / 0.0199) + 0.01), 1e-14);
  EXPECT_THAT(state.first, ElementsAre(DoubleNear(0.08, 1e-16)));
  EXPECT_THAT(state.second, ElementsAre(DoubleNear(0.0496, 1e-16)));
}

TEST(Adam, FirstStepIsTheLearningRateWhateverTheGradient) {
  std::vector<double> weights = {0, 0, 0};
  AdamState state;
  adam(weights, std::vector<double>{1e-3, -7, 0}, state, 0.5, {});
  EXPECT_NEAR(weights[0], -0.5, 1e-5);
  EXPECT_NEAR(weights[1], 0.5, 1e-8);
  EXPECT_EQ(weights[2], 0);
}

TEST(LimitGradient, ScalesTheWholeToTheNorm) {
  std::vector<double> gradient = {3, -4};
  EXPECT_DOUBLE_EQ(limit_gradient(gradient, {.clip_norm = 1}), 5);
  EXPECT_THAT(gradient, ElementsAre(DoubleNear(0.6, 1e-15), DoubleNear(-0.8, 1e-15)));

  gradient = {0.3, -0.4};
  EXPECT_DOUBLE_EQ(limit_gradient(gradient, {.clip_norm = 1}), 0.5);
  EXPECT_THAT(gradient, ElementsAre(0.3, -0.4));

  gradient = {3, -4};
  limit_gradient(gradient, {.clip_norm = 0});
  EXPECT_THAT(gradient, ElementsAre(3, -4));
}

TEST(LimitGradient, LimitsEntriesBeforeTheNorm) {
  std::vector<double> gradient = {30, -0.5, -2};
  EXPECT_DOUBLE_EQ(limit_gradient(gradient, {.clip_value = 1, .clip_norm = 0}), std::sqrt(904.25));
  EXPECT_THAT(gradient, ElementsAre(1, -0.5, -1));

  gradient = {30, 0, -40};
  limit_gradient(gradient, {.clip_value = 1, .clip_norm = 1});
  EXPECT_THAT(gradient,
              ElementsAre(DoubleNear(std::sqrt(0.5), 1e-15), 0, DoubleNear(-std::sqrt(0.5), 1e-15)));
}

TEST(LimitGradient, TellsOfNumbersThatAreNotFinite) {
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()})
    for (const double clip : {0.0, 1.0}) {
      std::vector<double> gradient = {1, bad};
      EXPECT_FALSE(std::isfinite(limit_gradient(gradient, {.clip_value = clip})));
    }
}

TEST(Average, WarmsUp) {
  EXPECT_DOUBLE_EQ(average_decay(0.999, 0), 0.1);
  EXPECT_DOUBLE_EQ(average_decay(0.999, 90), 0.91);
  EXPECT_DOUBLE_EQ(average_decay(0.999, 1'000'000), 0.999);
  EXPECT_DOUBLE_EQ(average_decay(0, 100), 0);

  std::vector<double> mean = {1, 10};
  average(mean, std::vector<double>{2, 0}, 0.75);
  EXPECT_THAT(mean, ElementsAre(1.25, 7.5));
}

TEST(LearningRate, RisesThenFallsAlongACosine) {
  TrainOptions options;
  options.steps = 104;
  options.optimizer.lr = 2;
  options.schedule = {.warmup = 4, .floor = 0.1};
  EXPECT_DOUBLE_EQ(learning_rate(options, 0), 0.5);
  EXPECT_DOUBLE_EQ(learning_rate(options, 3), 2);
  EXPECT_DOUBLE_EQ(learning_rate(options, 4), 2);
  EXPECT_DOUBLE_EQ(learning_rate(options, 37), 2 * (0.1 + 0.9 * 0.75));  // a third of the way: cos 60°
  EXPECT_NEAR(learning_rate(options, 103), 0.2, 1e-15);
  EXPECT_NEAR(learning_rate(options, 5000), 0.2, 1e-15);

  options.schedule.warmup = 0;
  EXPECT_DOUBLE_EQ(learning_rate(options, 0), 2);
  options.schedule.warmup = 1000;  // longer than the run
  EXPECT_DOUBLE_EQ(learning_rate(options, 103), 0.208);
  options.steps = 1;
  options.schedule.warmup = 0;
  EXPECT_TRUE(std::isfinite(learning_rate(options, 0)));
}

}  // namespace
}  // namespace bitr::train
