// Pairs that invite a wrong answer: right, or not sure and a plain reason.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bitr/generate.hpp>

#include "solve/scenes.hpp"

namespace bitr {
namespace {

using namespace test;

void expect_not_sure(const Solution& solution) {
  EXPECT_LT(solution.best.confidence, 0.5);
  EXPECT_FALSE(solution.reasons.empty());
}

bool everywhere(double, double) { return true; }
double flat(double, double) { return 0; }

TEST(SolveTraps, APlaneOnAPlane) {
  Random random(1);
  expect_not_sure(solved(sheet(random, 3000, flat, everywhere), sheet(random, 3000, flat, everywhere)));
  // Partly shared: where along it, nobody knows.
  expect_not_sure(solved(sheet(
                             random, 3000, flat, [](double x, double) { return x < 0.2; }, 0.003),
                         moved(sheet(
                                   random, 3000, flat, [](double x, double) { return x > -0.2; }, 0.003),
                               random_pose(random))));
}

TEST(SolveTraps, ASphereOnASphere) {
  Random random(2);
  expect_not_sure(solved(sphere(random, 3000), sphere(random, 2500)));
}

TEST(SolveTraps, ALine) {
  PointCloud line;
  for (int i = 0; i < 500; ++i) line.positions.push_back({0.01 * i, 0, 0});
  Random random(3);
  const Solution solution = solved(line, moved(line, random_pose(random)));
  expect_not_sure(solution);
}

TEST(SolveTraps, PointsInOnePlace) {
  PointCloud place;
  place.positions.assign(50, {1, 2, 3});
  const Scene scene = overlapping_hills(3, 500);
  expect_not_sure(solved(place, scene.reference));
  expect_not_sure(solved(place, place));
}

TEST(SolveTraps, AHundredPoints) {
  const Scene scene = overlapping_hills(4, 100);
  const Solution solution = solved(scene.pair());
  if (rotation_error_degrees(solution.best.T_reference_source, scene.truth) > 5) expect_not_sure(solution);
}

TEST(SolveTraps, MillimetresAgainstMetres) {
  const Scene scene = overlapping_hills(5);
  for (const double factor : {1e3, 1e-3}) {
    const Solution solution = solved(scaled(scene.source, factor), scene.reference);
    expect_not_sure(solution);
    EXPECT_THAT(solution.reasons.front(), testing::HasSubstr("other units?"));
  }
}

TEST(SolveTraps, NormalsOfTheOtherSide) {
  Random random(6);
  Scene scene = overlapping_hills(6);
  for (PointCloud* cloud : {&scene.source, &scene.reference}) cloud->normals.resize(cloud->size());
  // Exact ones, upwards in the hills' own frame; the source is the reference, moved.
  Random same(6);
  PointCloud surface = sheet(same, 4000, hills, everywhere);
  for (const Vec3d& p : surface.positions) {
    constexpr double h = 1e-6;
    const Eigen::Vector3d n = Eigen::Vector3d(-(hills(p[0] + h, p[1]) - hills(p[0] - h, p[1])) / (2 * h),
                                              -(hills(p[0], p[1] + h) - hills(p[0], p[1] - h)) / (2 * h), 1)
                                  .normalized();
    surface.normals.push_back({static_cast<float>(n[0]), static_cast<float>(n[1]), static_cast<float>(n[2])});
  }
  const Pose motion = random_pose(random);
  const Solution solution = solved(flipped(surface), moved(surface, motion));
  EXPECT_LE(rotation_error_degrees(solution.best.T_reference_source, motion), 1);
  EXPECT_GE(solution.best.confidence, 0.5);
}

TEST(SolveTraps, SurfacesThatHaveNothingInCommon) {
  Random random(7);
  const auto other = [](double x, double y) {
    return 0.3 * std::cos(5 * x * y + 2) + 0.2 * std::sin(6 * x - y * y);
  };
  for (int i = 0; i < 3; ++i) {
    const PointCloud a = sheet(random, 3000, hills, everywhere, 0.002);
    const PointCloud b = moved(sheet(random, 3000, other, everywhere, 0.002), random_pose(random));
    expect_not_sure(solved(a, b));
  }
}

TEST(SolveTraps, PiecesThatOnlyMeet) {
  for (const char* kind : {"aircraft", "vessels"})
    for (const std::uint64_t seed : {5, 6}) {
      const auto pair = *generate_pair(
          kind, {.points = 6000, .noise = 0.001, .seed = seed, .protocol = Protocol::opposed, .share = 0.5});
      const Solution solution = solved(pair.source, pair.reference);
      SCOPED_TRACE(kind + std::string(", seed ") + std::to_string(seed));
      const double error = rotation_error_degrees(solution.best.T_reference_source, pair.T_reference_source);
      SCOPED_TRACE(solution.best.proposal + ", " + std::to_string(error) + " degrees");
      if (error > solution.best.within_degrees) expect_not_sure(solution);
    }
}

TEST(SolveTraps, AMirrorImage) {
  PointCloud mirrored = overlapping_hills(8).source;
  const PointCloud surface = mirrored;
  for (Vec3d& p : mirrored.positions) p[0] = -p[0];
  expect_not_sure(solved(surface, mirrored));
}

}  // namespace
}  // namespace bitr
