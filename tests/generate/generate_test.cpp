#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bitr/generate.hpp>
#include <chrono>
#include <cmath>
#include <string>

namespace bitr {
namespace {

using testing::HasSubstr;

double distance(const Vec3d& a, const Vec3d& b) { return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]); }

TEST(GeneratePair, EveryKindGivesTheSameTwiceAndSomethingElseForAnotherSeed) {
  for (const GeneratedKind& kind : generated_kinds()) {
    SCOPED_TRACE(std::string(kind.name));
    const GenerateOptions options{.points = 300, .noise = 0.001, .seed = 5};
    const GeneratedPair a = generate_pair(kind.name, options).value();
    const GeneratedPair b = generate_pair(kind.name, options).value();
    EXPECT_EQ(a.source.positions, b.source.positions);
    EXPECT_EQ(a.reference.positions, b.reference.positions);
    EXPECT_EQ(a.reference.normals, b.reference.normals);
    EXPECT_EQ(a.T_reference_source.matrix(), b.T_reference_source.matrix());
    EXPECT_EQ(a.source.size(), 300u);
    EXPECT_EQ(a.reference.normals.size(), 300u);
    const GeneratedPair other = generate_pair(kind.name, {.points = 300, .seed = 6}).value();
    EXPECT_NE(a.source.positions, other.source.positions);
    EXPECT_GT(rotation_error_degrees(a.T_reference_source, other.T_reference_source), 1);
  }
}

TEST(GeneratePair, ShapeAndPosesDoNotDependOnTheNumberOfPoints) {
  const GeneratedPair few = generate_pair("fragments", {.points = 100, .seed = 2}).value();
  const GeneratedPair many = generate_pair("fragments", {.points = 200, .seed = 2}).value();
  EXPECT_EQ(few.T_reference_source.matrix(), many.T_reference_source.matrix());
  for (std::size_t i = 0; i < few.source.size(); ++i)
    EXPECT_EQ(few.source.positions[i], many.source.positions[i]);
}

TEST(GeneratePair, CopyIsTheSourceMovedByTheTruth) {
  const GeneratedPair pair = generate_pair("copy", {.points = 500, .seed = 7}).value();
  for (std::size_t i = 0; i < pair.source.size(); ++i) {
    EXPECT_LT(distance(pair.T_reference_source.apply(pair.source.positions[i]), pair.reference.positions[i]),
              1e-14);
    const Vec3f& n = pair.source.normals[i];
    const Vec3d turned = pair.T_reference_source.rotate({n[0], n[1], n[2]});
    for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(turned[axis], pair.reference.normals[i][axis], 1e-6);
  }
}

TEST(GeneratePair, FragmentsMeetAlongTheBreakWithOpposedNormals) {
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    const GeneratedPair pair = generate_pair("fragments", {.points = 3000, .seed = seed}).value();
    std::size_t touching = 0;
    double agreement = 0;
    for (std::size_t i = 0; i < pair.source.size(); ++i) {
      const Vec3d at = pair.T_reference_source.apply(pair.source.positions[i]);
      const Vec3f& n = pair.source.normals[i];
      const Vec3d normal = pair.T_reference_source.rotate({n[0], n[1], n[2]});
      std::size_t nearest = 0;
      for (std::size_t j = 1; j < pair.reference.size(); ++j)
        if (distance(at, pair.reference.positions[j]) < distance(at, pair.reference.positions[nearest]))
          nearest = j;
      if (distance(at, pair.reference.positions[nearest]) > 0.005) continue;
      ++touching;
      for (int axis = 0; axis < 3; ++axis) agreement += normal[axis] * pair.reference.normals[nearest][axis];
    }
    EXPECT_GT(touching, 100u) << seed;  // a tenth of a fragment's surface or so is the break
    EXPECT_LT(agreement / static_cast<double>(touching), -0.5) << seed;
  }
}

TEST(GeneratePair, NoiseHasItsDeviation) {
  const GeneratedPair clean = generate_pair("copy", {.points = 4000, .seed = 8}).value();
  const GeneratedPair noisy = generate_pair("copy", {.points = 4000, .noise = 0.01, .seed = 8}).value();
  double square = 0;
  for (std::size_t i = 0; i < clean.source.size(); ++i)
    square += std::pow(distance(clean.source.positions[i], noisy.source.positions[i]), 2) / 3 / 4000;
  EXPECT_NEAR(std::sqrt(square), 0.01, 0.0003);
  EXPECT_NE(noisy.source.positions, noisy.reference.positions);
}

TEST(GeneratePair, RefusesWhatIsOutOfRangeAndNamesIt) {
  const auto message = [](std::string_view kind, const GenerateOptions& options) {
    const auto pair = generate_pair(kind, options);
    EXPECT_FALSE(pair.has_value());
    if (pair) return std::string();
    EXPECT_EQ(pair.error().code, ErrorCode::invalid_argument);
    return pair.error().message;
  };
  EXPECT_THAT(message("plane", {}), HasSubstr("\"plane\"; known: fragments, copy"));
  EXPECT_THAT(message("copy", {.points = 0}), HasSubstr("points is 0"));
  EXPECT_THAT(message("copy", {.points = max_generated_points + 1}), HasSubstr("10000001"));
  EXPECT_THAT(message("copy", {.noise = -1}), HasSubstr("noise"));
  EXPECT_THAT(message("copy", {.noise = std::nan("")}), HasSubstr("noise"));
  EXPECT_THAT(message("copy", {.roughness = 0.2}), HasSubstr("roughness"));
}

TEST(GeneratePair, TakesLessThanASecond) {
  const auto start = std::chrono::steady_clock::now();
  const int pairs = 5;
  for (int i = 0; i < pairs; ++i)
    EXPECT_TRUE(
        generate_pair("fragments", {.points = 2048, .seed = static_cast<std::uint64_t>(i)}).has_value());
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  RecordProperty("ms_per_pair", std::to_string(1000 * elapsed.count() / pairs));
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  EXPECT_LT(elapsed.count() / pairs, 1.0);
#endif
}

}  // namespace
}  // namespace bitr
