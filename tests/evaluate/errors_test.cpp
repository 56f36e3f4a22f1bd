#include <gtest/gtest.h>

#include <algorithm>
#include <bitr/evaluate.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "core/random.hpp"

namespace bitr {
namespace {

/// About an axis through the origin, by Rodrigues' formula applied to the unit vectors.
Pose turn(Vec3d axis, double degrees) {
  const double length = std::hypot(axis[0], axis[1], axis[2]), angle = degrees * std::numbers::pi / 180;
  for (double& a : axis) a /= length;
  Pose pose;
  for (int column = 0; column < 3; ++column) {
    Vec3d e{};
    e[column] = 1;
    const Vec3d cross = {axis[1] * e[2] - axis[2] * e[1], axis[2] * e[0] - axis[0] * e[2],
                         axis[0] * e[1] - axis[1] * e[0]};
    for (int row = 0; row < 3; ++row)
      pose.rotation[3 * row + column] = e[row] * std::cos(angle) + cross[row] * std::sin(angle) +
                                        axis[row] * axis[column] * (1 - std::cos(angle));
  }
  return pose;
}

Pose shift(double x, double y, double z) { return {.translation = {x, y, z}}; }

/// A box 3 × 4 × 12 (diagonal 13) in two halves, each in a frame of its own.
DataSample box(const Symmetry& symmetry = {}) {
  DataSample sample;
  sample.T_source_object = shift(0.7, -0.2, 5) * turn({1, 2, 3}, 77);
  const Pose T_reference_object = shift(-3, 0.5, 0.1) * turn({-1, 0.3, 2}, 141);
  sample.T_reference_source = T_reference_object * sample.T_source_object.inverse();
  sample.symmetry = symmetry;
  for (const double z : {-6.0, 0.0})
    for (const double x : {-1.5, 1.5})
      for (const double y : {-2.0, 2.0}) {
        sample.source.positions.push_back(sample.T_source_object.apply({x, y, z}));
        sample.reference.positions.push_back(T_reference_object.apply({x, y, -z}));
      }
  return sample;
}

/// The truth, after the object was moved in its own frame.
Pose moved_truth(const DataSample& sample, const Pose& motion) {
  return sample.T_reference_source * sample.T_source_object * motion * sample.T_source_object.inverse();
}

TEST(Errors, AreZeroForTheTruth) {
  const DataSample sample = box();
  EXPECT_NEAR(object_diagonal(sample), 13, 1e-12);
  const PoseErrors errors = errors_of(sample.T_reference_source, sample);
  EXPECT_EQ(errors.rotation, 0);
  EXPECT_EQ(errors.translation, 0);
  EXPECT_FALSE(errors.failed);
}

TEST(Errors, DoNotDependOnTheFrames) {
  const DataSample sample = box();
  const PoseErrors turned = errors_of(moved_truth(sample, turn({3, -1, 2}, 33)), sample);
  EXPECT_NEAR(turned.rotation, 33, 1e-10);
  EXPECT_NEAR(turned.translation, 0, 1e-12);
  const PoseErrors shifted = errors_of(moved_truth(sample, shift(1.2, 0, 0.5)), sample);
  EXPECT_NEAR(shifted.rotation, 0, 1e-6);
  EXPECT_NEAR(shifted.translation, 1.3, 1e-12);
  EXPECT_NEAR(shifted.translation_fraction, 0.1, 1e-12);
  const PoseErrors both = errors_of(moved_truth(sample, shift(0, 2.6, 0) * turn({1, 1, 0}, 170)), sample);
  EXPECT_NEAR(both.rotation, 170, 1e-10);
  EXPECT_NEAR(both.translation_fraction, 0.2, 1e-12);
}

TEST(Errors, TurnsOfASymmetricShapeAreNone) {
  const Vec3d axis = {0.6, 0, 0.8}, across = {0.8, 0, -0.6};
  for (const std::uint32_t order : {2u, 3u, 5u}) {
    const DataSample sample = box({axis, order});
    for (std::uint32_t k = 0; k < order; ++k) {
      const Pose same = turn(axis, 360.0 * k / order);
      EXPECT_NEAR(errors_of(moved_truth(sample, same), sample).rotation, 0, 1e-6) << order << ' ' << k;
      EXPECT_NEAR(errors_of(moved_truth(sample, turn(axis, 9) * same), sample).rotation, 9, 1e-9);
      EXPECT_NEAR(errors_of(moved_truth(sample, turn(across, 20) * same), sample).rotation, 20, 1e-9);
    }
    EXPECT_NEAR(errors_of(moved_truth(sample, turn(axis, 180.0 / order)), sample).rotation, 180.0 / order,
                1e-9);
  }
  const DataSample sample = box({axis, 0});
  EXPECT_NEAR(errors_of(moved_truth(sample, turn(axis, 123)), sample).rotation, 0, 1e-6);
  EXPECT_NEAR(errors_of(moved_truth(sample, turn(axis, 123) * turn(across, 40)), sample).rotation, 40, 1e-9);
  EXPECT_NEAR(errors_of(moved_truth(sample, turn(across, 180)), sample).rotation, 180, 1e-6);
  EXPECT_NEAR(errors_of(moved_truth(sample, shift(0, 0, 1.3) * turn(axis, 50)), sample).translation, 1.3,
              1e-12);
  // Without symmetry the same pose is wrong.
  EXPECT_NEAR(errors_of(moved_truth(box(), turn(axis, 123)), box()).rotation, 123, 1e-9);
}

TEST(Errors, AreLeastOverAllTurns) {
  Random random(5);
  for (const std::uint32_t order : {0u, 2u, 3u, 4u, 7u}) {
    const DataSample sample = box({{0, 0, 1}, order});
    const std::uint32_t turns = order ? order : 720;
    for (int i = 0; i < 50; ++i) {
      Pose pose;
      pose.rotation = random.rotation();
      double least = 180;
      for (std::uint32_t k = 0; k < turns; ++k)
        least = std::min(
            least, rotation_error_degrees(pose, moved_truth(sample, turn({0, 0, 1}, 360.0 * k / turns))));
      EXPECT_NEAR(errors_of(pose, sample).rotation, least, order ? 1e-9 : 0.3);
      EXPECT_LE(errors_of(pose, sample).rotation, least + 1e-9);
    }
  }
}

TEST(Errors, APoseThatIsNoNumberIsAMiss) {
  Pose pose;
  pose.rotation[4] = std::numeric_limits<double>::quiet_NaN();
  const PoseErrors errors = errors_of(pose, box());
  EXPECT_TRUE(errors.failed);
  EXPECT_EQ(errors.rotation, 180);
  EXPECT_EQ(errors.translation_fraction, 1);
  EXPECT_NEAR(errors.translation, 13, 1e-12);
}

TEST(Summary, OfFewErrorsByHand) {
  const std::vector<PoseErrors> errors = {{5, 0.2, 0.1},  {15, 0.2, 0.30}, {4, 0.4, 0.2},
                                          {10, 0.4, 0.1}, {136, 1.8, 0.9}, {180, 3.0, 1.5, true}};
  const ErrorSummary summary = summarise(errors);
  EXPECT_EQ(summary.pairs, 6u);
  EXPECT_EQ(summary.failed, 1u);
  EXPECT_NEAR(summary.rotation.median, 12.5, 1e-12);
  EXPECT_NEAR(summary.rotation.mean, 350.0 / 6, 1e-12);
  EXPECT_NEAR(summary.rotation.std, 71.699992, 1e-5);
  EXPECT_NEAR(summary.translation.mean, 1, 1e-12);
  EXPECT_NEAR(summary.translation.std, std::sqrt((0.64 * 2 + 0.36 * 2 + 0.64 + 4) / 6), 1e-12);
  EXPECT_NEAR(summary.translation_fraction.median, 0.25, 1e-12);
  EXPECT_NEAR(summary.success_5, 1.0 / 6, 1e-12);
  EXPECT_NEAR(summary.success_15, 4.0 / 6, 1e-12);
  EXPECT_NEAR(summary.recall_5, 2.0 / 6, 1e-12);
  EXPECT_NEAR(summary.recall_10, 3.0 / 6, 1e-12);
  EXPECT_NEAR(summary.recall_20, 4.0 / 6, 1e-12);
  EXPECT_NEAR(summary.flips, 2.0 / 6, 1e-12);
  EXPECT_EQ(summarise({}).pairs, 0u);
  EXPECT_EQ(summarise(std::span(errors).first(1)).rotation.median, 5);
}

TEST(Summary, MediansErrorIsWhatMediansSpreadBy) {
  Random random(8);
  double squares = 0, claimed = 0;
  constexpr int trials = 400;
  for (int trial = 0; trial < trials; ++trial) {
    std::vector<PoseErrors> errors(201);
    for (PoseErrors& error : errors) error.rotation = random.uniform(0, 100);
    const ErrorSummary summary = summarise(errors);
    squares += (summary.rotation.median - 50) * (summary.rotation.median - 50) / trials;
    claimed += summary.rotation.median_error / trials;
  }
  EXPECT_NEAR(std::sqrt(squares), claimed, 0.15 * claimed);
}

}  // namespace
}  // namespace bitr
