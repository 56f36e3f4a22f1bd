// The streamed transport plan against one that is written out.
#include "refine/sinkhorn.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.hpp"
#include "refine/transport.hpp"

namespace bitr::refine {
namespace {

std::vector<Vec3d> random_points(Random& random, std::size_t count, double extent = 1) {
  std::vector<Vec3d> points(count);
  for (Vec3d& point : points)
    for (double& value : point) value = extent * random.uniform(-1, 1);
  return points;
}

std::vector<Vec3d> random_normals(Random& random, std::size_t count) {
  std::vector<Vec3d> normals(count);
  for (Vec3d& normal : normals) {
    const auto r = random.rotation();
    normal = {r[0], r[3], r[6]};
  }
  return normals;
}

/// As defined: a matrix with a row and a column of slack, rows and columns normalised in turn.
Eigen::MatrixXd dense_log_plan(const std::vector<Vec3d>& X, const std::vector<Vec3d>& Y,
                               const std::vector<Vec3d>& NX, const std::vector<Vec3d>& NY, double length,
                               const Affinity& affinity, int iterations) {
  const auto n = static_cast<Eigen::Index>(X.size()), m = static_cast<Eigen::Index>(Y.size());
  Eigen::MatrixXd logs = Eigen::MatrixXd::Zero(n + 1, m + 1);
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < m; ++j) {
      double squared = 0;
      for (int a = 0; a < 3; ++a) {
        const auto s = static_cast<std::size_t>(i), r = static_cast<std::size_t>(j);
        squared += std::pow(X[s][a] - Y[r][a], 2);
        if (!NX.empty()) squared += std::pow(length * (NX[s][a] - NY[r][a]), 2);
      }
      logs(i, j) = affinity.beta * (affinity.alpha - squared);
    }
  const auto log_sum = [](const auto& terms) {
    const double most = terms.maxCoeff();
    return most + std::log((terms.array() - most).exp().sum());
  };
  for (int k = 0; k < iterations; ++k) {
    for (Eigen::Index i = 0; i < n; ++i) logs.row(i).array() -= log_sum(logs.row(i));
    for (Eigen::Index j = 0; j < m; ++j) logs.col(j).array() -= log_sum(logs.col(j));
  }
  return logs;
}

TEST(Sinkhorn, StreamedIsDense) {
  Random random(1);
  for (const auto& [n, m, normals] : {std::tuple{3, 3, false},
                                      {5, 64, false},
                                      {64, 5, true},
                                      {65, 130, true},
                                      {200, 127, false},
                                      {300, 300, true}}) {
    const auto X = random_points(random, n), Y = random_points(random, m);
    const auto NX = normals ? random_normals(random, n) : std::vector<Vec3d>{};
    const auto NY = normals ? random_normals(random, m) : std::vector<Vec3d>{};
    const Affinity affinity{.beta = 30, .alpha = 0.2};
    ThreadPool pool(2);
    Sinkhorn plan({X, NX, 0.3}, {Y, NY, 0.3}, {&pool});
    EXPECT_EQ(plan.normalise(affinity, {.most_iterations = 7, .tolerance = 0}), 7);
    const Eigen::MatrixXd dense = dense_log_plan(X, Y, NX, NY, 0.3, affinity, 7);
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < m; ++j)
        EXPECT_NEAR(plan.log_plan(i, j), dense(i, j), 1e-9 * (1 + std::abs(dense(i, j))));

    Eigen::ArrayXd weights;
    Eigen::ArrayXXd targets;
    plan.project(weights, targets);
    for (int row = 0; row < n; ++row) {
      const auto i = static_cast<Eigen::Index>(plan.source().order()[row]);
      const Eigen::ArrayXd P = dense.row(i).head(m).array().exp().transpose();
      EXPECT_NEAR(weights[row], P.sum(), 1e-10);
      double x = 0;
      for (int j = 0; j < m; ++j) x += P[j] * Y[j][0];
      EXPECT_NEAR(targets(row, 0), x, 1e-10);
    }
  }
}

TEST(Sinkhorn, StopsWhenThePlanStandsStill) {
  Random random(2);
  const auto X = random_points(random, 80), Y = random_points(random, 70);
  const Affinity affinity{.beta = 5, .alpha = 0.1};
  Sinkhorn plan({X, {}, 0}, {Y, {}, 0}, {});
  const int stopped = plan.normalise(affinity, {.most_iterations = 5000, .tolerance = 1e-5});
  ASSERT_LT(stopped, 5000);
  const auto at = [&](int iterations) {
    return dense_log_plan(X, Y, {}, {}, 0, affinity, iterations).topLeftCorner(80, 70).array().exp().eval();
  };
  EXPECT_LT((at(stopped) - at(stopped - 1)).abs().sum(), 1e-5 * 1.0001);
  EXPECT_GT((at(stopped - 1) - at(stopped - 2)).abs().sum(), 1e-5 * 0.9999);
}

TEST(Sinkhorn, MemoryIsLinear) {
  Random random(3);
  const auto small = random_points(random, 1000), large = random_points(random, 4000);
  const Sinkhorn one({small, {}, 0}, {small, {}, 0}, {}), four({large, {}, 0}, {large, {}, 0}, {});
  EXPECT_LE(four.bytes(), 4 * one.bytes() + 4096);
  EXPECT_LE(four.bytes(), std::size_t{8000} * 200);
}

TEST(Transport, TwentyThousandPointsEachInLinearMemory) {
  Random random(4);
  const auto points = random_points(random, 20'000);
  TransportStage stage;
  stage.affinity = {.beta = 5000, .alpha = 0.002};
  stage.sinkhorn.most_iterations = 2;
  stage.most_iterations = 1;
  const TransportResult result = transport({points, {}}, {points, {}}, {}, {&stage, 1});
  EXPECT_LE(result.workspace_bytes, std::size_t{40'000} * 200);
  EXPECT_LE(rotation_error_degrees(result.T_reference_source, {}), 0.1);
}

TEST(Transport, SameBitsForAnyNumberOfThreads) {
  Random random(5);
  const auto X = random_points(random, 400), Y = random_points(random, 300);
  const auto stages = narrowing_stages(false);
  std::vector<Pose> poses;
  for (const unsigned threads : {1u, 2u, 3u}) {
    ThreadPool pool(threads);
    poses.push_back(transport({X, {}}, {Y, {}}, {}, std::span(stages).first(2), {&pool}).T_reference_source);
  }
  for (const Pose& pose : poses) {
    EXPECT_EQ(pose.rotation, poses[0].rotation);
    EXPECT_EQ(pose.translation, poses[0].translation);
  }
}

}  // namespace
}  // namespace bitr::refine
