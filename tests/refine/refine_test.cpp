#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bitr/generate.hpp>
#include <bitr/io.hpp>
#include <bitr/refine.hpp>
#include <cmath>
#include <limits>

#include "refine/overlap.hpp"
#include "support/random_motion.hpp"
#include "support/turn.hpp"

namespace bitr {
namespace {

using testing::HasSubstr;

struct Made {
  GeneratedPair pair;
  Pose start;
};

/// Aircraft cut from opposite ends, and a start that is `degrees` and a little shift off the truth.
Made make(std::uint64_t seed, std::size_t points, double degrees, double noise = 0.005) {
  GenerateOptions options;
  options.points = points;
  options.noise = noise;
  options.seed = seed;
  options.protocol = Protocol::opposed;
  Made made{generate_pair("aircraft", options).value(), {}};
  Random random(seed);
  Pose off = test::turn_about(test::random_unit(random), degrees);
  off.translation = {0.01, -0.01, 0.005};
  const Pose& T = made.pair.T_source_object;
  made.start = made.pair.T_reference_source * T * off * T.inverse();
  return made;
}

Refinement refined(const CloudPair& pair, const Pose& start, const RefineOptions& options = {},
                   unsigned threads = 1) {
  auto result = refine_poses(cpu_device(threads), {&pair, 1}, {&start, 1}, options);
  EXPECT_TRUE(result) << (result ? "" : result.error().message);
  return result->front();
}

Refinement refined(const Made& made, const RefineOptions& options = {}) {
  return refined({made.pair.source, made.pair.reference}, made.start, options);
}

TEST(Refine, BringsAnswersHome) {
  for (const RefineMethod method : {RefineMethod::icp, RefineMethod::transport}) {
    std::vector<double> errors;
    for (std::uint64_t seed = 0; seed < 5; ++seed) {
      const Made made = make(seed, 600, 8);
      const Refinement result = refined(made, {.method = method});
      EXPECT_TRUE(result.improved) << result.reason;
      EXPECT_EQ(result.reason, "");
      EXPECT_GT(result.score_after, result.score_before);
      EXPECT_EQ(result.T_reference_source.rotation, result.proposal.rotation);
      errors.push_back(rotation_error_degrees(result.T_reference_source, made.pair.T_reference_source));
    }
    std::sort(errors.begin(), errors.end());
    EXPECT_LE(errors[2], 1.5) << name(method);
  }
}

TEST(Refine, OverlapIsTheShareThatHasACounterpart) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    Made made = make(seed, 500, 20);
    EXPECT_EQ(refine::overlap_at({made.pair.source, made.pair.reference}, made.start, {}),
              refined(made).overlap_before);
    made.pair.source.normals.clear();
    const CloudPair pair{made.pair.source, made.pair.reference};
    const double limit = 3 * refined(pair, made.start).spacing;
    const auto share = [&](const PointCloud& from, const PointCloud& to, const Pose& T) {
      const auto has_counterpart = [&](const Vec3d& point) {
        const Vec3d moved = T.apply(point);
        return std::ranges::any_of(to.positions, [&](const Vec3d& other) {
          return std::hypot(moved[0] - other[0], moved[1] - other[1], moved[2] - other[2]) < limit;
        });
      };
      return static_cast<double>(std::ranges::count_if(from.positions, has_counterpart)) /
             static_cast<double>(from.positions.size());
    };
    const double expected = std::max(share(made.pair.source, made.pair.reference, made.start),
                                     share(made.pair.reference, made.pair.source, made.start.inverse()));
    EXPECT_GT(expected, 0);
    EXPECT_LT(expected, 1);
    EXPECT_DOUBLE_EQ(refine::overlap_at(pair, made.start, {}), expected);
  }
}

TEST(Refine, DensityDoesNotMatter) {
  for (const std::size_t points : {600, 3000, 15000}) {
    const Made made = make(2, points, 8);
    const Refinement result = refined(made);
    EXPECT_TRUE(result.improved) << points << ": " << result.reason;
    EXPECT_GT(result.overlap_before, 0.4);
    EXPECT_LE(rotation_error_degrees(result.T_reference_source, made.pair.T_reference_source), 1.5) << points;
    EXPECT_LE(result.workspace_bytes,
              200 * (made.pair.source.size() + made.pair.reference.size()) + 4'000'000);
  }
}

TEST(Refine, OfACopyIsExact) {
  const PointCloud cloud = generate_shape("aircraft", 3, 500).value().cloud;
  Random random(4);
  const Pose motion = test::random_pose(random);
  PointCloud moved;
  for (const Vec3d& point : cloud.positions) moved.positions.push_back(motion.apply(point));
  for (const bool normals : {false, true}) {
    PointCloud source = cloud, reference = moved;
    if (normals)
      for (const Vec3f& n : cloud.normals) {
        const Vec3d turned = motion.rotate({n[0], n[1], n[2]});
        reference.normals.push_back(
            {static_cast<float>(turned[0]), static_cast<float>(turned[1]), static_cast<float>(turned[2])});
      }
    const Pose start = motion * test::turn_about({0, 0, 1}, 3);
    const Refinement result = refined({source, reference}, start);
    EXPECT_LE(rotation_error_degrees(result.T_reference_source, motion), 1e-4);
    EXPECT_LE(translation_error(result.T_reference_source, motion), 1e-6);
    EXPECT_NEAR(result.score_after, 1, 1e-6);
    EXPECT_EQ(result.overlap, 1);
  }
}

PointCloud moved(const PointCloud& cloud, const Pose& pose, double scale) {
  PointCloud result;
  for (Vec3d point : cloud.positions) {
    for (double& value : point) value *= scale;
    result.positions.push_back(pose.apply(point));
  }
  for (const Vec3f& n : cloud.normals) {
    const Vec3d turned = pose.rotate({n[0], n[1], n[2]});
    result.normals.push_back(
        {static_cast<float>(turned[0]), static_cast<float>(turned[1]), static_cast<float>(turned[2])});
  }
  return result;
}

TEST(Refine, MovesAndScalesWithTheClouds) {
  Random random(6);
  for (const RefineMethod method : {RefineMethod::icp, RefineMethod::transport})
    for (const bool normals : {true, false}) {
      Made made = make(7, 400, 6);
      if (!normals) made.pair.source.normals = made.pair.reference.normals = {};
      const Refinement plain = refined(made, {.method = method});
      const double scale = std::exp(random.uniform(-7, 7));
      const Pose X = test::random_pose(random, 10 * scale), Y = test::random_pose(random, 10 * scale);
      Pose start = made.start, expected = plain.T_reference_source;
      for (Pose* pose : {&start, &expected}) {
        for (double& value : pose->translation) value *= scale;
        *pose = Y * *pose * X.inverse();
      }
      const PointCloud source = moved(made.pair.source, X, scale),
                       reference = moved(made.pair.reference, Y, scale);
      const Refinement result = refined({source, reference}, start, {.method = method});
      EXPECT_EQ(result.iterations, plain.iterations);
      EXPECT_LE(rotation_error_degrees(result.T_reference_source, expected), 1e-3) << scale;
      EXPECT_LE(translation_error(result.T_reference_source, expected), 1e-4 * scale);
      EXPECT_NEAR(result.score_after, plain.score_after, 1e-4);
      EXPECT_NEAR(result.spacing, scale * plain.spacing, 1e-6 * scale);
    }
}

TEST(Refine, IsNeverWorseThanItsStart) {
  std::vector<PointCloud> clouds;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    clouds.push_back(generate_shape(seed % 2 ? "aircraft" : "solids", seed, 24 + seed).value().cloud);
    if (seed % 3 == 0) clouds.back().normals.clear();
  }
  Random random(8);
  std::vector<CloudPair> pairs;
  std::vector<Pose> starts;
  constexpr std::size_t count = 10'000;
  for (std::size_t i = 0; i < count; ++i) {
    const PointCloud& source = clouds[random.below(clouds.size())];
    const PointCloud& reference = random.below(2) ? source : clouds[random.below(clouds.size())];
    pairs.push_back({source, reference});
    starts.push_back(test::random_pose(random, random.uniform() * 0.5));
  }
  const Device device = cpu_device(2);
  const auto run = [&](std::size_t from, std::size_t to, const RefineOptions& options) {
    const std::span some_pairs = std::span(pairs).subspan(from, to - from);
    const std::span some_starts = std::span(starts).subspan(from, to - from);
    const auto results = refine_poses(device, some_pairs, some_starts, options).value();
    std::size_t improved = 0, worse = 0;
    for (std::size_t i = 0; i < results.size(); ++i) {
      const Refinement& r = results[i];
      improved += r.improved;
      const double score = refinement_score(device, some_pairs[i], r.T_reference_source).value();
      // Orientation of normals is decided at the pose that is given: compare where it is the same.
      const double start = refinement_score(device, some_pairs[i], some_starts[i]).value();
      worse += (r.improved ? r.score_after : r.score_before) < r.score_before;
      if (!r.improved) worse += score != start;
      if (r.improved) worse += r.score_after <= r.score_before;
    }
    EXPECT_EQ(worse, 0u);
    return improved;
  };
  EXPECT_GT(run(0, 4000, {.least_overlap = 0}), 2000u);
  run(4000, 7000, {});
  EXPECT_GT(run(7000, 9900, {.protocol = RefineProtocol::official}), 1000u);
  run(9900, count, {.method = RefineMethod::transport, .least_overlap = 0});
}

TEST(Refine, ThreadsAndBatchesChangeNothing) {
  std::vector<Made> made;
  for (std::uint64_t seed = 0; seed < 4; ++seed) made.push_back(make(seed, 300, 5));
  std::vector<CloudPair> pairs;
  std::vector<Pose> starts;
  for (const Made& m : made) {
    pairs.push_back({m.pair.source, m.pair.reference});
    starts.push_back(m.start);
  }
  const auto first = refine_poses(cpu_device(1), pairs, starts).value();
  for (const unsigned threads : {2u, 3u, 8u}) {
    const auto again = refine_poses(cpu_device(threads), pairs, starts).value();
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      EXPECT_EQ(first[i].T_reference_source.rotation, again[i].T_reference_source.rotation);
      EXPECT_EQ(first[i].T_reference_source.translation, again[i].T_reference_source.translation);
      EXPECT_EQ(first[i].score_after, again[i].score_after);
      EXPECT_EQ(first[i].score_after, refined(pairs[i], starts[i], {}, threads).score_after);
    }
  }
}

TEST(Refine, WhereCloudsOnlyMeetTheStartIsKept) {
  GenerateOptions options;
  options.points = 800;
  options.protocol = Protocol::opposed;
  options.share = 0.4;
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    options.seed = seed;
    const GeneratedPair pair = generate_pair("aircraft", options).value();
    const Refinement result = refined({pair.source, pair.reference}, pair.T_reference_source);
    EXPECT_FALSE(result.improved);
    EXPECT_THAT(result.reason, HasSubstr("too little to refine on"));
    EXPECT_EQ(result.iterations, 0);
    EXPECT_EQ(result.T_reference_source.rotation, pair.T_reference_source.rotation);
    EXPECT_LT(result.overlap_before, 0.2);
  }
}

TEST(Refine, NormalsMayBeWithoutASide) {
  Made made = make(11, 600, 6);
  Random random(1);
  for (PointCloud* cloud : {&made.pair.source, &made.pair.reference})
    for (Vec3f& n : cloud->normals)
      if (random.below(2)) n = {-n[0], -n[1], -n[2]};
  const Refinement result = refined(made);
  EXPECT_TRUE(result.improved) << result.reason;
  EXPECT_LE(rotation_error_degrees(result.T_reference_source, made.pair.T_reference_source), 2);
}

TEST(Refine, EdgesOfWhatItTakes) {
  const std::vector<std::vector<Vec3d>> clouds = {
      {{0, 0, 0}, {1, 0, 0}, {0, 2, 0}},                                              // the fewest
      {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}, {5, 0, 0}},                        // collinear
      {{1, 1, 1}, {1, 1, 1}, {1, 1, 1}, {1, 1, 1}},                                   // one place
      {{0, 0, 0}, {0, 0, 0}, {1, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 1, 0}, {0, 0, 1}},  // duplicates
      {{1e9, 1e9, 1e9}, {1e9 + 1, 1e9, 1e9}, {1e9, 1e9 + 2, 1e9}},                    // far away
  };
  Random random(3);
  for (const auto& x : clouds)
    for (const auto& y : clouds)
      for (const RefineMethod method : {RefineMethod::icp, RefineMethod::transport})
        for (const RefineProtocol protocol : {RefineProtocol::adaptive, RefineProtocol::official}) {
          PointCloud source, reference;
          source.positions = x;
          reference.positions = y;
          const Refinement result =
              refined({source, reference}, test::random_pose(random),
                      {.method = method, .protocol = protocol, .least_overlap = 0, .most_iterations = 20});
          for (const double value : result.T_reference_source.matrix()) EXPECT_TRUE(std::isfinite(value));
          EXPECT_GE(result.improved ? result.score_after : result.score_before, result.score_before);
        }
}

TEST(Refine, RefusesWhatIsWrong) {
  PointCloud good = generate_shape("solids", 1, 20).value().cloud, bad = good;
  const auto error = [](const PointCloud& source, const PointCloud& reference, const Pose& start,
                        const RefineOptions& options = {}) {
    const CloudPair pair = {source, reference};
    const auto result = refine_poses(cpu_device(1), {&pair, 1}, {&start, 1}, options);
    EXPECT_FALSE(result);
    EXPECT_EQ(result.error().code, ErrorCode::invalid_argument);
    return result.error().message;
  };
  bad.positions[3][1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(error(good, bad, {}), "reference: point 3 is not finite");
  bad = good;
  bad.positions.resize(2);
  bad.normals.resize(2);
  EXPECT_EQ(error(bad, good, {}), "source: 2 points; at least 3 are needed");
  bad = good;
  bad.normals.resize(7);
  EXPECT_EQ(error(bad, good, {}), "source: 7 normals for 20 points");
  Pose nowhere;
  nowhere.translation[0] = std::numeric_limits<double>::infinity();
  EXPECT_EQ(error(good, good, nowhere), "the start is not finite");
  EXPECT_THAT(error(good, good, {}, {.keep = 1.5}), HasSubstr("keep 1.5"));
  EXPECT_THAT(error(good, good, {}, {.most_iterations = 0}), HasSubstr("most_iterations 0"));
  EXPECT_THAT(error(good, good, {}, {.least_overlap = 2}), HasSubstr("least_overlap 2"));
  EXPECT_FALSE(refine_poses(cpu_device(1), {}, std::vector<Pose>(1)));
}

}  // namespace
}  // namespace bitr
