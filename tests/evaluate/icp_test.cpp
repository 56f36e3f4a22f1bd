#include "refine/icp.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <bitr/generate.hpp>
#include <cmath>

#include "core/random.hpp"
#include "refine/principal_axes.hpp"
#include "support/golden_refinement.hpp"

namespace bitr {
namespace {

TEST(RefineGolden, EqualsTheOfficialIterations) {
  for (const char* name : {"icp0", "icp1"}) {
    const test::GoldenRefinement golden(name);
    const std::vector<Vec3d> source = golden.cloud("src").positions,
                             reference = golden.cloud("ref").positions;
    const Pose start = golden.pose("_init");
    const refine::IcpResult first = refine::Icp(reference, {.most_iterations = 1}).align(source, start);
    EXPECT_LE(rotation_error_degrees(first.T_reference_source, golden.pose("_after1")), 1e-8) << name;
    EXPECT_LE(translation_error(first.T_reference_source, golden.pose("_after1")), 1e-10) << name;

    const refine::IcpResult last = refine::Icp(reference).align(source, start);
    EXPECT_EQ(last.iterations, static_cast<int>(golden.values("iters")[0])) << name;
    EXPECT_LE(rotation_error_degrees(last.T_reference_source, golden.pose("")), 1e-8) << name;
    EXPECT_LE(translation_error(last.T_reference_source, golden.pose("")), 1e-10) << name;
  }
}

PointCloud aircraft(std::uint64_t seed, std::size_t points) {
  return generate_shape("aircraft", seed, points).value().cloud;
}

Pose small_motion(double degrees) {
  const double angle = degrees * 3.14159265358979 / 180;
  Pose pose;
  pose.rotation = {std::cos(angle), -std::sin(angle), 0, std::sin(angle), std::cos(angle), 0, 0, 0, 1};
  pose.translation = {0.02, -0.01, 0.015};
  return pose;
}

TEST(Icp, TakesBackASmallMotionOfACopy) {
  const std::vector<Vec3d> reference = aircraft(3, 800).positions;
  const Pose motion = small_motion(6);
  std::vector<Vec3d> source;
  for (const Vec3d& point : reference) source.push_back(motion.inverse().apply(point));
  const refine::IcpResult result = refine::Icp(reference, {.tolerance = 1e-9}).align(source, {});
  EXPECT_LE(rotation_error_degrees(result.T_reference_source, motion), 1e-6);
  EXPECT_LE(translation_error(result.T_reference_source, motion), 1e-8);
  EXPECT_LE(result.rmse, 1e-8);
}

TEST(Icp, TrimsWhatHasNoCounterpart) {
  const GeneratedPair pair = crop_pair(aircraft(4, 1500), {.share = 0.7, .seed = 2}).value();
  const Pose start =
      pair.T_reference_source * pair.T_source_object * small_motion(4) * pair.T_source_object.inverse();
  const auto error = [&](double keep) {
    const refine::IcpResult result = refine::Icp(pair.reference.positions, {.keep = keep, .tolerance = 1e-9})
                                         .align(pair.source.positions, start);
    return rotation_error_degrees(result.T_reference_source, pair.T_reference_source);
  };
  EXPECT_LE(error(0.4 / 0.7), 1e-6);
  EXPECT_GT(error(1.0), 1);
}

TEST(Icp, OfTheFewestPoints) {
  const std::vector<Vec3d> reference = {{0, 0, 0}, {1, 0, 0}, {0, 2, 0}};
  const refine::IcpResult result = refine::Icp(reference, {.keep = 0.1}).align(reference, small_motion(5));
  EXPECT_LE(rotation_error_degrees(result.T_reference_source, {}), 0.1);
  EXPECT_LE(result.iterations, 5);
}

TEST(PrincipalAxes, OneOfTheFourIsAnyMotionOfACopy) {
  Random random(2);
  const std::vector<Vec3d> source = aircraft(5, 600).positions;
  for (int i = 0; i < 10; ++i) {
    Pose motion;
    motion.rotation = random.rotation();
    motion.translation = {random.normal(), random.normal(), random.normal()};
    std::vector<Vec3d> reference;
    for (const Vec3d& point : source) reference.push_back(motion.apply(point));
    double least = 180;
    for (const Pose& pose : refine::align_principal_axes(source, reference)) {
      EXPECT_NEAR(Eigen::Map<const Eigen::Matrix3d>(pose.rotation.data()).determinant(), 1, 1e-12);
      least = std::min(least, rotation_error_degrees(pose, motion));
    }
    EXPECT_LE(least, 1e-6);
    const refine::IcpResult best = refine::icp_from_principal_axes(source, reference);
    EXPECT_LE(rotation_error_degrees(best.T_reference_source, motion), 1e-6);
    EXPECT_LE(translation_error(best.T_reference_source, motion), 1e-6);
  }
}

}  // namespace
}  // namespace bitr
