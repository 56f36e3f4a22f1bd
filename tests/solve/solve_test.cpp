// The whole road on pairs with a known answer: right, the same however the clouds are given, the same bits on any
// number of threads.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bitr/generate.hpp>
#include <bitr/model.hpp>
#include <numeric>

#include "solve/scenes.hpp"

namespace bitr {
namespace {

using namespace test;

constexpr double same_pose_degrees = 0.02;

void expect_right(const Solution& solution, const Pose& truth, double degrees) {
  EXPECT_LE(rotation_error_degrees(solution.best.T_reference_source, truth), degrees);
  EXPECT_GE(solution.best.confidence, 0.5);
  for (const SolvedPose& other : solution.alternatives) EXPECT_LT(other.confidence, solution.best.confidence);
}

TEST(Solve, OverlappingPartsOfASurface) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    const Scene scene = overlapping_hills(seed);
    const Solution solution = solved(scene.pair());
    expect_right(solution, scene.truth, 1);
    EXPECT_LE(farthest_apart(solution.best.T_reference_source, scene.truth, scene.source), 0.03) << seed;
  }
}

GeneratedPair aircraft(std::uint64_t seed, double share) {
  return *generate_pair(
      "aircraft",
      {.points = 8000, .noise = 0.001, .seed = seed, .protocol = Protocol::opposed, .share = share});
}

TEST(Solve, GeneratedObjectsThatOverlap) {
  for (const std::uint64_t seed : {6, 7, 8}) {
    const GeneratedPair pair = aircraft(seed, 0.75);
    expect_right(solved(pair.source, pair.reference), pair.T_reference_source, 1);
  }
}

TEST(Solve, HalvesOfABrokenBlock) {
  Random random(21);
  const PointCloud lower = block(
                       random, 6000, [](double, double) { return -1.2; }, hills),
                   upper = block(random, 6000, hills, [](double x, double) { return 1 + 0.2 * x; });
  const Pose a = random_pose(random), b = random_pose(random);
  const Solution solution = solved(moved(lower, a), moved(upper, b));
  EXPECT_LE(rotation_error_degrees(solution.best.T_reference_source, b * a.inverse()), 2);
  EXPECT_LE(farthest_apart(solution.best.T_reference_source, b * a.inverse(), moved(lower, a)), 0.1);
}

TEST(Solve, WhatLooksTheSameUpsideDownIsNamed) {
  const GeneratedPair pair = aircraft(5, 0.75);
  const Solution solution = solved(pair.source, pair.reference);
  EXPECT_LE(rotation_error_degrees(solution.best.T_reference_source, pair.T_reference_source), 1);
  EXPECT_LT(solution.best.confidence, 0.5);
  ASSERT_FALSE(solution.alternatives.empty());
  EXPECT_NEAR(rotation_error_degrees(solution.alternatives[0].T_reference_source, pair.T_reference_source),
              180, 3);
  EXPECT_THAT(solution.reasons.front(), testing::HasSubstr("another pose fits nearly as well"));
}

TEST(Solve, ClearlyMovedCopies) {
  const Scene scene = overlapping_hills(4);
  Random random(4);
  const Pose motion = random_pose(random, 5);
  const Solution solution = solved(scene.source, moved(scene.source, motion));
  expect_right(solution, motion, 0.01);
}

TEST(Solve, MovesWithEitherCloud) {
  const Scene scene = overlapping_hills(7);
  const Pose first = solved(scene.pair()).best.T_reference_source;
  Random random(7);
  const Pose a = random_pose(random, 10), b = random_pose(random, 10);
  const Pose second = solved(moved(scene.source, a), moved(scene.reference, b)).best.T_reference_source;
  EXPECT_LE(rotation_error_degrees(b * first * a.inverse(), second), same_pose_degrees);
  EXPECT_LE(farthest_apart(b * first * a.inverse(), second, moved(scene.source, a)), 1e-3);
}

TEST(Solve, SwappedCloudsHaveTheInversePose) {
  const Scene scene = overlapping_hills(8);
  const Pose first = solved(scene.pair()).best.T_reference_source;
  const Pose second = solved(scene.reference, scene.source).best.T_reference_source;
  EXPECT_LE(rotation_error_degrees(first.inverse(), second), same_pose_degrees);
}

TEST(Solve, TheOrderOfThePointsIsOfNoConsequence) {
  const Scene scene = overlapping_hills(9);
  PointCloud shuffled = scene.source;
  Random random(9);
  for (std::size_t i = shuffled.size(); i > 1; --i)
    std::swap(shuffled.positions[i - 1], shuffled.positions[random.below(i)]);
  EXPECT_LE(rotation_error_degrees(solved(scene.pair()).best.T_reference_source,
                                   solved(shuffled, scene.reference).best.T_reference_source),
            same_pose_degrees);
}

TEST(Solve, UnitsAndFarPlacesAreOfNoConsequence) {
  const Scene scene = overlapping_hills(10);
  const Solution first = solved(scene.pair());
  for (const double factor : {1e-3, 1e3}) {
    const Solution second = solved(scaled(scene.source, factor), scaled(scene.reference, factor));
    EXPECT_LE(rotation_error_degrees(first.best.T_reference_source, second.best.T_reference_source),
              same_pose_degrees);
    EXPECT_NEAR(first.best.confidence, second.best.confidence, 1e-2);
    EXPECT_NEAR(second.resolution / first.resolution, factor, 1e-6 * factor);
  }
  // As maps in UTM coordinates are.
  Pose away;
  away.translation = {448'262, 5'411'932, 117};
  const Pose far = solved(scene.source, moved(scene.reference, away)).best.T_reference_source;
  EXPECT_LE(rotation_error_degrees(first.best.T_reference_source, far), same_pose_degrees);
}

TEST(Solve, SameBitsOnAnyNumberOfThreadsAndAmongOtherPairs) {
  const Scene scene = overlapping_hills(11), other = overlapping_hills(12, 1500);
  const Solution one = solved(scene.pair(), 1);
  const auto expect_same = [&](const Solution& two) {
    EXPECT_EQ(one.best.T_reference_source.matrix(), two.best.T_reference_source.matrix());
    EXPECT_EQ(one.best.confidence, two.best.confidence);
    ASSERT_EQ(one.alternatives.size(), two.alternatives.size());
    for (std::size_t i = 0; i < one.alternatives.size(); ++i)
      EXPECT_EQ(one.alternatives[i].T_reference_source.matrix(),
                two.alternatives[i].T_reference_source.matrix());
  };
  for (const unsigned threads : {1u, 2u, 4u}) expect_same(solved(scene.pair(), threads));
  const CloudPair both[] = {other.pair(), scene.pair()};
  expect_same((*solve(cpu_device(2), both))[1]);
}

TEST(Solve, NetworksProposeToo) {
  // No surface is in both.
  const GeneratedPair halves = *generate_pair(
      "aircraft",
      {.points = 1024, .noise = 0.005, .seed = 20005, .protocol = Protocol::opposed, .share = 0.5});
  const CloudPair pair{halves.source, halves.reference};
  const Solution solution = solved(pair);
  EXPECT_EQ(solution.best.proposal, "aircraft");
  EXPECT_EQ(solution.best.within_degrees, 20);
  EXPECT_GE(solution.best.confidence, 0.5);
  EXPECT_LE(rotation_error_degrees(solution.best.T_reference_source, halves.T_reference_source), 10);
  // The same halves folded onto each other, which their surfaces alone would take.
  const Solution blind = solved(pair, 2, {.models = std::vector<Model>()});
  EXPECT_NE(blind.best.proposal, "aircraft");
  EXPECT_GT(rotation_error_degrees(blind.best.T_reference_source, halves.T_reference_source), 90);
  // Nothing to read, nothing to say.
  const Solution nobody = solved(pair, 2, {.models = std::vector<Model>(), .geometry = false});
  EXPECT_EQ(nobody.best.confidence, 0);
  EXPECT_TRUE(nobody.alternatives.empty());
}

TEST(Solve, EstimatedNormalsMakeNoNetworkSure) {
  GeneratedPair halves = *generate_pair(
      "aircraft",
      {.points = 1024, .noise = 0.005, .seed = 20006, .protocol = Protocol::opposed, .share = 0.5});
  halves.source.normals.clear();
  halves.reference.normals.clear();
  const Solution solution = solved({halves.source, halves.reference}, 2, {.geometry = false});
  EXPECT_LT(solution.best.confidence, sure);
  EXPECT_THAT(solution.reasons, testing::Contains(testing::HasSubstr("shown estimated ones")));
}

TEST(Solve, RestrictionTakesEveryPoseToTheFamily) {
  const Scene scene = overlapping_hills(3);
  const Restriction upright{.axis = Vec3d{0, 0, 1}};
  const Solution free = solved(scene.pair()), held = solved(scene.pair(), 2, {.restriction = upright});
  ASSERT_TRUE(held.restricted);
  for (int a = 0; a < 3; ++a) EXPECT_NEAR(held.best.T_reference_source.rotation[6 + a], a == 2, 1e-12);
  EXPECT_LE(held.best.confidence, free.best.confidence);
  // A pose of the family stays what it is.
  const Scene turned{scene.source, moved(scene.reference, scene.truth.inverse()), {}};
  const Solution same = solved(turned.pair(), 2, {.restriction = upright});
  EXPECT_LE(rotation_error_degrees(same.best.T_reference_source, {}), 0.5);
  EXPECT_GE(same.best.confidence, sure);
}

TEST(Solve, AViewpointIsFinite) {
  const Scene scene = overlapping_hills(15);
  CloudPair pair = scene.pair();
  pair.source_viewpoint = Vec3d{1, 2, std::numeric_limits<double>::infinity()};
  const auto refused = solve(cpu_device(1), {&pair, 1});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::invalid_argument);
  EXPECT_THAT(refused.error().message, testing::HasSubstr("source: its viewpoint is not finite"));
}

TEST(Solve, RowsThatAreNotFiniteAreLeftOut) {
  Scene scene = overlapping_hills(13);
  const Solution without = solved(scene.pair());
  scene.source.positions.insert(scene.source.positions.begin() + 100, 50,
                                Vec3d{std::numeric_limits<double>::quiet_NaN(), 0, 0});
  const Solution with = solved(scene.pair());
  EXPECT_EQ(with.source_dropped, 50u);
  EXPECT_EQ(with.reference_dropped, 0u);
  EXPECT_EQ(with.best.T_reference_source.matrix(), without.best.T_reference_source.matrix());
}

TEST(Solve, RefusesWhatIsNoCloud) {
  PointCloud two;
  two.positions = {{0, 0, 0}, {1, 0, 0}};
  const Scene scene = overlapping_hills(14, 300);
  const CloudPair pair = {two, scene.reference};
  const auto solution = solve(cpu_device(1), {&pair, 1});
  ASSERT_FALSE(solution);
  EXPECT_EQ(solution.error().code, ErrorCode::invalid_argument);
  EXPECT_THAT(solution.error().message, testing::HasSubstr("source: 2 finite points; at least 3 are needed"));
  PointCloud wrong = scene.source;
  wrong.normals.resize(3, {0, 0, 1});
  const CloudPair normals = {scene.reference, wrong};
  EXPECT_THAT(solve(cpu_device(1), {&normals, 1}).error().message,
              testing::HasSubstr("reference: 3 normals for 300 points"));
}

}  // namespace
}  // namespace bitr
