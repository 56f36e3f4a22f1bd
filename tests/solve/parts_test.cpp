// The stages, each for itself.
#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "core/thread_pool.hpp"
#include "refine/rigid_fit.hpp"
#include "solve/consistency.hpp"
#include "solve/descriptors.hpp"
#include "solve/judge.hpp"
#include "solve/matching.hpp"
#include "solve/prepare.hpp"
#include "solve/scenes.hpp"
#include "solve/settle.hpp"

namespace bitr::solving {
namespace {

using namespace test;

double apart(const Vec3d& a, const Vec3d& b) { return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]); }

TEST(SolveParts, ThinningKeepsItsDistanceAndLeavesNoGap) {
  Random random(1);
  Thinned cloud;
  for (int i = 0; i < 3000; ++i) cloud.points.push_back({random.uniform(), random.uniform(), 0});
  const Thinned thinned = thin(cloud, 0.05);
  // Discs of half the distance do not overlap: at most 1.05² · 2/(√3 · 0.05²); maximal: those of the whole cover.
  EXPECT_LT(thinned.points.size(), 1.05 * 1.05 * 2 / (std::sqrt(3.0) * 0.05 * 0.05));
  EXPECT_GT(thinned.points.size(), 1 / (3.15 * 0.05 * 0.05));
  // Means stay within the distance of what they stand for.
  for (const Vec3d& p : cloud.points) {
    double least = 1;
    for (const Vec3d& q : thinned.points) least = std::min(least, apart(p, q));
    EXPECT_LT(least, 0.1);
  }
}

TEST(SolveParts, ThinningMovesWithTheCloud) {
  Random random(2);
  Thinned cloud, moved;
  const Pose T = random_pose(random);
  for (int i = 0; i < 2000; ++i) {
    cloud.points.push_back({random.uniform(), random.uniform(), random.uniform()});
    moved.points.insert(moved.points.begin(), T.apply(cloud.points.back()));
  }
  const Thinned a = thin(cloud, 0.1), b = thin(moved, 0.1);
  ASSERT_EQ(a.points.size(), b.points.size());
  for (std::size_t i = 0; i < a.points.size(); ++i)
    EXPECT_LT(apart(T.apply(a.points[i]), b.points[i]), 1e-12);
}

TEST(SolveParts, EstimatedNormalsPointToTheViewpointOrWhereThoseAroundDo) {
  Random random(4);
  PointCloud ball = sphere(random, 3000);
  ThreadPool pool(2);
  // From the middle every normal points inwards.
  const Prepared seen = prepare(ball, Vec3d{0, 0, 0});
  const auto inward = levels(seen, seen, 1000, 7, 100, pool);
  ASSERT_TRUE(inward->source.given_normals);
  for (std::size_t i = 0; i < inward->source.size(); ++i)
    EXPECT_LT(vector(inward->source.normals[i]).dot(vector(inward->source.points[i])), -0.9);
  // Half of the normals are missing, the others point outwards.
  for (const Vec3d& p : ball.positions) {
    const Vec3f n = {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
    ball.normals.push_back(p[0] > 0 ? n : Vec3f{});
  }
  const Prepared some = prepare(ball);
  const auto outward = levels(some, some, 1000, 7, 100, pool);
  std::size_t beside = 0;
  for (std::size_t i = 0; i < outward->source.size(); ++i) {
    const Eigen::Vector3d p = vector(outward->source.points[i]);
    if (p.x() < -0.15) continue;
    beside += p.x() < 0;
    EXPECT_GT(vector(outward->source.normals[i]).dot(p), 0.9);
  }
  EXPECT_GT(beside, 20u);
}

struct Ready {
  Scene scene = overlapping_hills(3);
  Prepared source = prepare(scene.source), reference = prepare(scene.reference);
  ThreadPool pool{2};
  std::unique_ptr<LevelPair> held = levels(source, reference, 2000, 7, 100, pool);
  const LevelPair& level = *held;
  Pose truth() const {
    Pose in, out;
    in.translation = source.centroid;
    out.translation = reference.centroid;
    return out.inverse() * scene.truth * in;
  }
};

TEST(SolveParts, LevelsHaveOneResolutionAndNoMorePointsThanAsked) {
  const Ready ready;
  EXPECT_EQ(ready.level.source.resolution, ready.level.reference.resolution);
  EXPECT_LE(std::max(ready.level.source.size(), ready.level.reference.size()), 2000u);
  EXPECT_GE(ready.level.source.size(), 1200u);
  // Never finer than the clouds themselves.
  ThreadPool pool(1);
  const auto fine = levels(ready.source, ready.reference, 1'000'000, 7, 100, pool);
  EXPECT_DOUBLE_EQ(fine->source.resolution, std::max(ready.source.grain, ready.reference.grain));
}

TEST(SolveParts, NormalsAreThoseOfTheSurface) {
  const Ready ready;
  const Level& level = ready.level.source;
  double sum = 0;
  std::size_t inside = 0;
  for (std::size_t i = 0; i < level.size(); ++i) {
    EXPECT_NEAR(vector(level.normals[i]).norm(), 1, 1e-9);
    if (level.rim[i]) continue;
    // The nearest neighbours lie across the normal.
    const Eigen::Vector3d way =
        (vector(level.points[ready.level.near_source.index[i * ready.level.near_source.most]]) -
         vector(level.points[i]))
            .normalized();
    sum += std::abs(way.dot(vector(level.normals[i])));
    ++inside;
  }
  EXPECT_GT(inside, level.size() / 2);
  EXPECT_LT(inside, level.size());
  EXPECT_LT(sum / static_cast<double>(inside), 0.2);
}

TEST(SolveParts, DescriptorsAreTheSameInEveryFrameAndFlipWithTheNormals) {
  Ready ready;
  Random random(4);
  const Pose T = random_pose(random);
  const double radius[] = {5 * ready.level.source.resolution};
  const Prepared turned = prepare(moved(ready.scene.source, T));
  const auto held = levels(turned, ready.reference, 2000, 7, 100, ready.pool);
  const LevelPair& other = *held;
  ASSERT_EQ(other.source.size(), ready.level.source.size());
  const auto describe_level = [&](const LevelPair& pair, double sign) {
    std::vector<Vec3d> normals = signed_normals(pair.source, pair.near_source, Signs::outward);
    for (Vec3d& n : normals)
      for (double& c : n) c *= sign;
    return describe(pair.source, pair.near_source, normals, radius, ready.pool)[0];
  };
  const Descriptors a = describe_level(ready.level, 1), b = describe_level(other, 1);
  // Rounding puts a value on a bin's edge into the next one, here and there.
  EXPECT_LT((a - b).cwiseAbs().mean(), 1e-4f);
  const Descriptors back = flipped(describe_level(ready.level, -1));
  EXPECT_LT((a - back).cwiseAbs().mean(), 5e-3f);
  EXPECT_GT((a - describe_level(ready.level, -1)).cwiseAbs().mean(), 2e-2f);
}

TEST(SolveParts, MutualNearestIsWhatItSays) {
  Random random(5);
  Descriptors a(descriptor_size, 700), b(descriptor_size, 900);
  for (Descriptors* m : {&a, &b})
    for (Eigen::Index i = 0; i < m->size(); ++i) m->data()[i] = static_cast<float>(random.uniform());
  ThreadPool one(1), four(4);
  const std::vector<Pairing> found = mutual_nearest(a, b, four);
  const std::vector<Pairing> again = mutual_nearest(a, b, one);
  ASSERT_EQ(found.size(), again.size());
  std::vector<Pairing> plain;
  const auto distance = [&](Eigen::Index i, Eigen::Index j) {
    return (a.col(i).cast<double>() - b.col(j).cast<double>()).squaredNorm();
  };
  for (Eigen::Index i = 0; i < a.cols(); ++i) {
    Eigen::Index j = 0, k = 0;
    for (Eigen::Index c = 1; c < b.cols(); ++c)
      if (distance(i, c) < distance(i, j)) j = c;
    for (Eigen::Index c = 1; c < a.cols(); ++c)
      if (distance(c, j) < distance(k, j)) k = c;
    if (k == i) plain.push_back({static_cast<std::uint32_t>(i), static_cast<std::uint32_t>(j), 0});
  }
  ASSERT_EQ(found.size(), plain.size());
  for (std::size_t i = 0; i < plain.size(); ++i) {
    EXPECT_EQ(found[i].source, plain[i].source);
    EXPECT_EQ(found[i].reference, plain[i].reference);
    EXPECT_EQ(found[i].distance, again[i].distance);
  }
}

TEST(SolveParts, ConsensusFindsTheMotionAmongManyWrongPairings) {
  Ready ready;
  const Level &source = ready.level.source, &reference = ready.level.reference;
  const Pose truth = ready.truth();
  Random random(6);
  std::vector<Pairing> pairings;
  for (std::uint32_t i = 0; i < source.size() && pairings.size() < 60; i += 7) {
    const NearestWithin nearest = nearest_within(reference, truth.apply(source.points[i]), source.resolution);
    if (nearest.found()) pairings.push_back({i, nearest.index(), 0});
  }
  ASSERT_GE(pairings.size(), 40u);
  for (int i = 0; i < 900; ++i)
    pairings.push_back({static_cast<std::uint32_t>(random.below(source.size())),
                        static_cast<std::uint32_t>(random.below(reference.size())), 0});
  const std::vector<Hypothesis> found = consensus(source, reference, pairings, 10, ready.pool);
  ASSERT_FALSE(found.empty());
  EXPECT_LE(rotation_error_degrees(found[0].T, truth), 3);
  EXPECT_GE(found[0].support, 40);
}

TEST(SolveParts, IcpAndTheScoreFavourTheTruth) {
  const Ready ready;
  const Level &source = ready.level.source, &reference = ready.level.reference;
  const Pose truth = ready.truth();
  Pose start =
      refine::pose_of(Eigen::AngleAxisd(0.05, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix(),
                      Eigen::Vector3d(0.03, -0.02, 0.02)) *
      truth;
  const Pose settled = icp(source, reference, start, {.iterations = 60, .points = 100'000});
  EXPECT_LE(rotation_error_degrees(settled, truth), 0.5);
  EXPECT_GT(fit(source, reference, settled).score, 1.3 * fit(source, reference, start).score);
  EXPECT_LT(fit(source, reference, settled).source.conflict, 0.01);
}

TEST(SolveParts, SlackTellsAPlaneFromHills) {
  const Ready ready;
  const double score = fit(ready.level.source, ready.level.reference, ready.truth()).score;
  EXPECT_LT(slack(ready.level.source, ready.level.reference, ready.truth(), score), 0.6);
  Random random(7);
  const PointCloud plane = sheet(
      random, 4000, [](double, double) { return 0; }, [](double, double) { return true; });
  const Prepared prepared = prepare(plane);
  ThreadPool pool(1);
  const auto held = levels(prepared, prepared, 2000, 7, 100, pool);
  const LevelPair& level = *held;
  EXPECT_GT(slack(level.source, level.reference, {}, fit(level.source, level.reference, {}).score), 0.75);
}

TEST(SolveParts, MotionMeasuresHowFarPosesTakeThePoints) {
  const Ready ready;
  const Level& level = ready.level.source;
  Random random(8);
  const Pose a = random_pose(random), b = random_pose(random);
  double squares = 0;
  for (const Vec3d& p : level.points) squares += std::pow(apart(a.apply(p), b.apply(p)), 2);
  EXPECT_NEAR(Motion(level).between(a, b), std::sqrt(squares / static_cast<double>(level.size())), 1e-9);
}

}  // namespace
}  // namespace bitr::solving
