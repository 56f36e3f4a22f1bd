// What assemble() refuses, what it flags, and what verify() says.
#include <gmock/gmock.h>

#include <limits>

#include "property/network.hpp"

namespace bitr {
namespace {

using test::exact_cloud;
using test::ExactCloud;
using testing::AllOf;
using testing::HasSubstr;

class Input : public testing::Test {
 protected:
  // The message with which a batch is refused.
  std::string refusal(Plan& plan, std::vector<CloudPair> pairs) {
    const auto result = assemble(plan, pairs);
    if (result) return "accepted";
    EXPECT_EQ(result.error().code, ErrorCode::invalid_argument);
    return result.error().message;
  }
  Plan plan_ = test::plan_for(untrained_model().value(), {});
  Random random_{9};
  ExactCloud good_ = exact_cloud(random_, 60), other_ = exact_cloud(random_, 70);
};

TEST_F(Input, TooFewPointsNameTheCloudAndTheLimit) {
  const ExactCloud small = exact_cloud(random_, 24), enough = exact_cloud(random_, 25);
  EXPECT_THAT(refusal(plan_, {{small.view(), good_.view()}}),
              AllOf(HasSubstr("source cloud"), HasSubstr("24 points"), HasSubstr("at least 25")));
  EXPECT_THAT(refusal(plan_, {{good_.view(), other_.view()}, {good_.view(), small.view()}}),
              AllOf(HasSubstr("reference cloud of pair 1"), HasSubstr("24 points")));
  EXPECT_THAT(refusal(plan_, {{good_.view(), CloudView{}}}), HasSubstr("0 points"));
  EXPECT_EQ(refusal(plan_, {{enough.view(), good_.view()}}), "accepted");
}

TEST_F(Input, KeyPointsNeedTheirNeighboursToo) {
  ModelConfig config;
  config.key_mean_num = 40;
  Plan plan = test::plan_for(untrained_model(config).value(), {});
  const ExactCloud small = exact_cloud(random_, 39), enough = exact_cloud(random_, 40);
  EXPECT_THAT(refusal(plan, {{small.view(), good_.view()}}), HasSubstr("at least 40"));
  EXPECT_EQ(refusal(plan, {{enough.view(), enough.view()}}), "accepted");
}

TEST_F(Input, NonFiniteCoordinatesNameThePoint) {
  for (const double bad :
       {std::nan(""), std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()}) {
    ExactCloud broken = good_;
    broken.positions[37][1] = bad;
    EXPECT_THAT(refusal(plan_, {{good_.view(), broken.view()}}),
                AllOf(HasSubstr("reference cloud"), HasSubstr("point 37"), HasSubstr("not finite")));
  }
}

TEST_F(Input, CloudsWithoutExtentAreRefused) {
  ExactCloud same = good_;
  for (Vec3d& p : same.positions) p = {0.1, 1e6, -3};
  EXPECT_THAT(refusal(plan_, {{same.view(), good_.view()}}),
              AllOf(HasSubstr("source cloud"), HasSubstr("equal")));
}

TEST_F(Input, NormalsAndColoursAreAskedForByTheModelsThatReadThem) {
  ModelConfig config;
  config.return_normals = config.get_color = true;
  Plan plan = test::plan_for(untrained_model(config).value(), {});
  EXPECT_EQ(refusal(plan, {{good_.view(), other_.view()}}), "accepted");

  ExactCloud bare = good_;
  bare.normals.clear();
  EXPECT_THAT(refusal(plan, {{bare.view(), other_.view()}}),
              AllOf(HasSubstr("source cloud"), HasSubstr("normals"), HasSubstr("0 for 60 points")));
  EXPECT_EQ(refusal(plan_, {{bare.view(), other_.view()}}), "accepted");
  ExactCloud short_by_one = good_;
  short_by_one.normals.pop_back();
  EXPECT_THAT(refusal(plan, {{other_.view(), short_by_one.view()}}),
              AllOf(HasSubstr("reference cloud"), HasSubstr("59 for 60 points")));
  ExactCloud gray = good_;
  gray.colors.clear();
  EXPECT_THAT(refusal(plan, {{other_.view(), gray.view()}}),
              AllOf(HasSubstr("colours"), HasSubstr("reference")));
  ExactCloud broken = good_;
  broken.normals[5][2] = std::nan("");
  EXPECT_THAT(refusal(plan, {{broken.view(), other_.view()}}),
              AllOf(HasSubstr("normals, 5"), HasSubstr("not finite")));
}

TEST_F(Input, CapacityIsALimitOnPairsAndOnPoints) {
  const Model model = untrained_model().value();
  const std::vector<CloudPair> pairs = {{good_.view(), other_.view()}, {other_.view(), good_.view()}};
  const BatchShape shape = shape_of(pairs);
  EXPECT_EQ(shape.pairs, 2u);
  EXPECT_EQ(shape.points, 270u);  // complete matching also assembles (70, 70)
  Plan exact = make_plan(test::shared_device(), model, {2, 260}).value();
  EXPECT_EQ(refusal(exact, pairs), "accepted");
  Plan few_points = make_plan(test::shared_device(), model, {2, 259}).value();
  EXPECT_THAT(refusal(few_points, pairs),
              AllOf(HasSubstr("2 pairs"), HasSubstr("260 points"), HasSubstr("259")));
  Plan one_pair = make_plan(test::shared_device(), model, {1, 1000}).value();
  EXPECT_THAT(refusal(one_pair, pairs), AllOf(HasSubstr("2 pairs"), HasSubstr("the plan holds 1")));
  Plan enough = make_plan(test::shared_device(), model, shape).value();
  const auto all =
      assemble(enough, pairs, {.complete_match = true, .diagnostics = true, .swap_residual = true});
  EXPECT_TRUE(all) << all.error().message;
}

TEST_F(Input, PlansOfNoOrAbsurdCapacityAreRefused) {
  const Model model = untrained_model().value();
  for (const BatchShape shape : {BatchShape{0, 100}, BatchShape{1, 0}, BatchShape{1, std::size_t{1} << 40}}) {
    const auto plan = make_plan(test::shared_device(), model, shape);
    ASSERT_FALSE(plan);
    EXPECT_EQ(plan.error().code, ErrorCode::invalid_argument);
    EXPECT_THAT(plan.error().message, HasSubstr("capacity"));
  }
}

TEST_F(Input, NoPairsGiveNoAssemblies) { EXPECT_TRUE(assemble(plan_, {}).value().empty()); }

// An error leaves the plan usable.
TEST_F(Input, ARefusedBatchChangesNothing) {
  const Pose before = test::solve(plan_, good_.view(), other_.view()).T_reference_source;
  ExactCloud broken = good_;
  broken.positions[0][0] = std::nan("");
  refusal(plan_, {{broken.view(), other_.view()}});
  EXPECT_EQ(test::solve(plan_, good_.view(), other_.view()).T_reference_source.rotation, before.rotation);
}

struct Arithmetic {
  Precision precision;
  Backend backend;
  std::string name() const {
    return std::string(precision == Precision::f32 ? "f32" : "f64") +
           (backend == Backend::vulkan ? "_vulkan" : "");
  }
  friend std::ostream& operator<<(std::ostream& out, const Arithmetic& a) { return out << a.name(); }
};

class Shapes : public testing::TestWithParam<Arithmetic> {
 protected:
  void SetUp() override { BITR_NEEDS(GetParam().backend); }
  // Whatever the shape: a status, and a rotation where that says ok.
  void expect_sound(const ExactCloud& source, const ExactCloud& reference, const std::string& what) {
    const Device device = test::device_on(GetParam().backend);
    for (const Mode mode : {Mode::scale_exact, Mode::reference})
      for (const bool as_defined : {false, true})
        for (int seed = 0; seed < 2; ++seed) {
          if (as_defined && GetParam().backend == Backend::vulkan) continue;
          Plan plan =
              test::plan_for(untrained_model({}, seed).value(),
                             {.precision = GetParam().precision, .mode = mode, .as_defined = as_defined},
                             device, {.pairs = 1, .points = 300});
          const Assembly assembly = test::solve(plan, source.view(), reference.view(), {});
          statuses_.push_back(assembly.status);
          if (assembly.status == Status::failed) {
            EXPECT_FALSE(assembly.diagnostics.reason.empty()) << what;
            ADD_FAILURE() << what << ": a finite input became a non-finite number";
            continue;
          }
          EXPECT_EQ(assembly.status == Status::degenerate, assembly.diagnostics.degenerate) << what;
          EXPECT_EQ(assembly.diagnostics.reason.empty(), !assembly.diagnostics.degenerate) << what;
          const Pose& pose = assembly.T_reference_source;
          EXPECT_LE(rotation_error_degrees(pose * pose.inverse(), Pose{}), 1e-4) << what;
          for (double t : pose.translation) EXPECT_TRUE(std::isfinite(t)) << what;
        }
  }
  std::vector<Status> statuses_;
  Random random_{21};
};

// Around a line every rotation is as good as any other.
TEST_P(Shapes, ALineIsFlagged) {
  const Vec3d direction = {0.6, -0.48, 0.64};
  ExactCloud line = exact_cloud(random_, 100);
  for (Vec3d& p : line.positions) p = {p[0] * direction[0], p[0] * direction[1], p[0] * direction[2]};
  const ExactCloud blob = exact_cloud(random_, 80);
  expect_sound(line, blob, "line and blob");
  expect_sound(blob, line, "blob and line");
  expect_sound(line, line, "line and line");
  if (GetParam().precision == Precision::f32) return;
  for (const Status status : statuses_) EXPECT_EQ(status, Status::degenerate);
}

TEST_P(Shapes, LatticesPlanesAndDuplicatesAreSound) {
  ExactCloud lattice, plane, pairs = exact_cloud(random_, 100), two = exact_cloud(random_, 60);
  for (int x = -2; x <= 2; ++x)
    for (int y = -2; y <= 2; ++y)
      for (int z = -2; z <= 2; ++z) lattice.positions.push_back({x / 4.0, y / 4.0, z / 4.0});
  for (int i = 0; i < 100; ++i)
    plane.positions.push_back({random_.uniform(-1, 1), random_.uniform(-1, 1), 0});
  for (std::size_t i = 50; i < 100; ++i) pairs.positions[i] = pairs.positions[i - 50];
  for (std::size_t i = 0; i < 60; ++i) two.positions[i] = {i < 30 ? 0.5 : -0.5, 0.25, 0};
  const ExactCloud blob = exact_cloud(random_, 90);
  expect_sound(lattice, lattice, "lattice twice");
  expect_sound(lattice, blob, "lattice and blob");
  expect_sound(plane, blob, "plane and blob");
  expect_sound(plane, plane, "plane twice");
  expect_sound(pairs, blob, "every point twice");
  expect_sound(two, blob, "two places");
  expect_sound(two, two, "two places, twice");
}

TEST_P(Shapes, ExtremeSizesAreSound) {
  const ExactCloud x = exact_cloud(random_, 60), y = exact_cloud(random_, 60);
  for (const double c : {1e-6, 1e6}) expect_sound(test::scaled(x, c), test::scaled(y, c), std::to_string(c));
}

const Arithmetic arithmetics[] = {
    {Precision::f32, Backend::cpu}, {Precision::f64, Backend::cpu}, {Precision::f32, Backend::vulkan}};
INSTANTIATE_TEST_SUITE_P(Arithmetics, Shapes, testing::ValuesIn(arithmetics),
                         [](const auto& kind) { return kind.param.name(); });

class Verify : public testing::TestWithParam<Arithmetic> {
 protected:
  void SetUp() override { BITR_NEEDS(GetParam().backend); }
};

TEST_P(Verify, AGoodPairIsWithinEveryBound) {
  Random random(3);
  const ExactCloud source = exact_cloud(random, 400), reference = exact_cloud(random, 350);
  for (const test::Network& network : test::networks()) {
    Plan plan = test::plan_for(untrained_model(network.config, 1).value(),
                               {.precision = GetParam().precision}, test::device_on(GetParam().backend));
    const auto stages = verify(plan, {source.view(), reference.view()});
    ASSERT_TRUE(stages) << stages.error().message;
    EXPECT_GE(stages->size(), 12u);
    for (const StageDifference& stage : *stages)
      EXPECT_TRUE(stage.within()) << network.name << " " << stage.stage << ": " << stage.difference << " > "
                                  << stage.bound;
    EXPECT_EQ(stages->back().stage, "out.t");
  }
}

// What both passes are given says nothing about either.
TEST_P(Verify, ComparesNoInput) {
  ModelConfig config;
  config.return_normals = config.get_color = config.centroid_offset = true;
  Random random(4);
  const ExactCloud source = exact_cloud(random, 90), reference = exact_cloud(random, 70);
  Plan plan = test::plan_for(untrained_model(config, 1).value(), {.precision = GetParam().precision},
                             test::device_on(GetParam().backend));
  const auto stages = verify(plan, {source.view(), reference.view()});
  ASSERT_TRUE(stages) << stages.error().message;
  EXPECT_GE(stages->size(), 12u);
  for (const StageDifference& stage : *stages) {
    EXPECT_TRUE(stage.within()) << stage.stage << ": " << stage.difference << " > " << stage.bound;
    for (const char* input : {"positions", "normals", "colors", "offsets"}) EXPECT_NE(stage.stage, input);
  }
}

TEST_P(Verify, RefusesWhatAssembleRefuses) {
  Random random(3);
  const ExactCloud small = exact_cloud(random, 10), fine = exact_cloud(random, 100);
  Plan plan = test::plan_for(untrained_model().value(), {}, test::device_on(GetParam().backend));
  const auto stages = verify(plan, {small.view(), fine.view()});
  ASSERT_FALSE(stages);
  EXPECT_EQ(stages.error().code, ErrorCode::invalid_argument);
}

INSTANTIATE_TEST_SUITE_P(Arithmetics, Verify, testing::ValuesIn(arithmetics),
                         [](const auto& kind) { return kind.param.name(); });

TEST(Diagnostics, MeasureTheOverlapOfACopy) {
  Random random(8);
  const ExactCloud source = exact_cloud(random, 500);
  const Pose g = test::random_pose(random);
  const ExactCloud copy = test::moved(source, g);
  Plan plan = test::plan_for(untrained_model().value(), {.precision = Precision::f64, .mode = {}});
  const Assembly found =
      test::solve(plan, source.view(), copy.view(), {.complete_match = true, .swap_residual = true});
  EXPECT_EQ(found.diagnostics.overlap, 1.0);
  ASSERT_TRUE(found.diagnostics.inlier_rmse && found.diagnostics.inlier_threshold &&
              found.diagnostics.swap_residual);
  EXPECT_LE(*found.diagnostics.inlier_rmse, 1e-8);
  EXPECT_GT(*found.diagnostics.inlier_threshold, 0.01);
  EXPECT_LE(*found.diagnostics.swap_residual, 1e-8);
  const Assembly plain = test::solve(plan, source.view(), copy.view(), {.diagnostics = false});
  EXPECT_FALSE(plain.diagnostics.overlap || plain.diagnostics.inlier_rmse || plain.diagnostics.swap_residual);
}

}  // namespace
}  // namespace bitr
