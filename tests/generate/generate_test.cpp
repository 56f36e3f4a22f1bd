#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bitr/generate.hpp>
#include <cmath>
#include <ctime>
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
    const std::size_t points = kind.name == "aircraft" ? 210 : 300;  // cropped to 0.7 of it
    EXPECT_EQ(a.source.size(), points);
    EXPECT_EQ(a.reference.normals.size(), points);
    const GeneratedPair other = generate_pair(kind.name, {.points = 300, .seed = 6}).value();
    EXPECT_NE(a.source.positions, other.source.positions);
    EXPECT_GT(rotation_error_degrees(a.T_reference_source, other.T_reference_source), 1);
  }
}

// Positions to 1e-6, run together: rounding differs from machine to machine, shapes do not.
std::uint64_t checksum(const PointCloud& cloud) {
  std::uint64_t sum = 0;
  for (const Vec3d& point : cloud.positions)
    for (const double x : point)
      sum = (sum ^ static_cast<std::uint64_t>(std::llround(x * 1e6))) * 0x100000001b3ULL;
  return sum;
}

TEST(GeneratePair, ShapesAndPairsAreWhatTheyHaveAlwaysBeen) {
  struct Expected {
    const char* kind;
    std::uint64_t seed, shape, source, reference;
  };
  const Expected all[] = {
      {"fragments", 1, 0xa319f5187c067a37, 0x1aa0a76c11f13ca, 0x43c39f68b910db48},
      {"fragments", 20, 0x82897723fe4f32cb, 0xaca0f75c6a312ad3, 0x74346630359e1228},
      {"copy", 1, 0xa319f5187c067a37, 0x810552f09f2d0f8b, 0x784d0244511386f0},
      {"copy", 20, 0x82897723fe4f32cb, 0xfe441c01210b96c, 0x5c204a6b4faffc9c},
      {"vessels", 1, 0x4c53c4b18a0f599, 0x6d073d456611bcdf, 0x465d7903b24ac8d4},
      {"vessels", 20, 0x19a141149062726, 0x927c41e1b544d746, 0xa7bc96f7d6fdb5c3},
      {"aircraft", 1, 0x496572d0de8689d1, 0x32333aa87b48c908, 0xc26081af25bedec6},
      {"aircraft", 20, 0xb6bb9bfdb556bc1e, 0xdda1032302caea32, 0x6da506ff41a4a8c9},
  };
  for (const auto& [kind, seed, shape, source, reference] : all) {
    SCOPED_TRACE(std::string(kind) + " " + std::to_string(seed));
    const bool own = std::string_view(kind) == "vessels" || std::string_view(kind) == "aircraft";
    EXPECT_EQ(checksum(generate_shape(own ? kind : "solids", seed, 64).value().cloud), shape);
    const GeneratedPair pair = generate_pair(kind, {.points = 64, .noise = 0.01, .seed = seed}).value();
    EXPECT_EQ(checksum(pair.source), source);
    EXPECT_EQ(checksum(pair.reference), reference);
  }
}

TEST(GeneratePair, EveryKindCanBeCropped) {
  for (const GeneratedKind& kind : generated_kinds())
    for (const ProtocolName& protocol : protocols()) {
      SCOPED_TRACE(std::string(kind.name) + " " + std::string(protocol.name));
      const GeneratedPair pair =
          generate_pair(kind.name, {.points = 400, .seed = 3, .protocol = protocol.protocol, .share = 0.6})
              .value();
      const bool complement = protocol.protocol == Protocol::complement;
      EXPECT_NEAR(static_cast<double>(pair.reference.size()), 240, 12);
      EXPECT_NEAR(static_cast<double>(pair.source.size()), complement ? 160 : 240, 12);
      if (complement) {
        EXPECT_EQ(pair.overlap, 0);
      } else if (protocol.protocol == Protocol::opposed) {
        EXPECT_NEAR(pair.overlap, 0.2, 0.06);
      }
    }
}

TEST(GenerateShape, IsThatOfThePairAndSaysHowItIsSymmetric) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const GeneratedShape vessel = generate_shape("vessels", seed, 200).value();
    const GeneratedPair pair =
        generate_pair("vessels", {.points = 200, .seed = seed, .protocol = Protocol::independent, .share = 1})
            .value();
    EXPECT_EQ(pair.overlap, 1);
    EXPECT_EQ(pair.symmetry.order, vessel.symmetry.order);
    // The first sample is the same, so in the object's frame the source is the shape.
    for (std::size_t i = 0; i < 200; ++i)
      EXPECT_LT(distance(pair.T_source_object.apply(vessel.cloud.positions[i]), pair.source.positions[i]),
                1e-14);
    EXPECT_EQ(generate_pair("vessels", {.points = 20, .seed = seed}).value().symmetry.order,
              vessel.symmetry.order);
  }
  EXPECT_EQ(generated_shapes().size(), 3u);
  EXPECT_THAT(generate_shape("tables", 0, 10).error().message, HasSubstr("known: solids, vessels, aircraft"));
  EXPECT_THAT(generate_shape("solids", 0, 0).error().message, HasSubstr("points is 0"));
}

TEST(GeneratePair, ShapeAndPosesDoNotDependOnTheNumberOfPoints) {
  const GeneratedPair few = generate_pair("copy", {.points = 100, .seed = 2}).value();
  const GeneratedPair many = generate_pair("copy", {.points = 200, .seed = 2}).value();
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
  EXPECT_THAT(message("plane", {}), HasSubstr("\"plane\"; known: fragments, copy, vessels, aircraft"));
  EXPECT_THAT(message("copy", {.points = 0}), HasSubstr("points is 0"));
  EXPECT_THAT(message("copy", {.points = max_generated_points + 1}), HasSubstr("10000001"));
  EXPECT_THAT(message("copy", {.noise = -1}), HasSubstr("noise"));
  EXPECT_THAT(message("copy", {.noise = std::nan("")}), HasSubstr("noise"));
  EXPECT_THAT(message("copy", {.roughness = 0.2}), HasSubstr("roughness"));
  EXPECT_THAT(message("aircraft", {.share = 2}), HasSubstr("share is 2"));
  EXPECT_THAT(message("vessels", {.protocol = Protocol::complement, .share = 1}), HasSubstr("share is 1"));
}

TEST(GeneratePair, TakesMilliseconds) {
  for (const GeneratedKind& kind : generated_kinds()) {
    const std::size_t points = kind.name == "aircraft" ? 1463 : 1024;  // the crop leaves 1024 of them
    const int pairs = 40;
    const auto start = std::clock();
    for (int i = 0; i < pairs; ++i)
      EXPECT_TRUE(
          generate_pair(kind.name, {.points = points, .seed = static_cast<std::uint64_t>(i)}).has_value());
    const double milliseconds = 1000.0 * static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC / pairs;
    RecordProperty("ms_per_pair_of_" + std::string(kind.name), std::to_string(milliseconds));
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    EXPECT_LT(milliseconds, 100) << kind.name;
#endif
  }
}

}  // namespace
}  // namespace bitr
