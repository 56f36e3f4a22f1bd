// The same promises in single precision, on the CPU and on Vulkan. Float rounds coordinates to 6e-8 and can
// exchange near-tied neighbours of the 6-D graph; on pairs whose rotation is well determined that moves the
// pose by far less than these bounds.
#include "property/network.hpp"

namespace bitr {
namespace {

using test::ExactCloud;
using test::Network;
using test::solve;

constexpr double bound_f32 = 8.7e-4;  // for rotations (0.05°) and translations over the clouds' extent
constexpr double least_gap = 0.2;     // from which on a rotation counts as well determined
constexpr int pairs_to_check = 8;     // per network

class FloatProperty : public testing::TestWithParam<std::tuple<Network, Backend>> {
 protected:
  void SetUp() override { BITR_NEEDS(backend()); }
  const Network& network() const { return std::get<0>(GetParam()); }
  Backend backend() const { return std::get<1>(GetParam()); }

  // Calls check(plan, source, reference, f, extent) on well-determined pairs.
  template <class Check>
  void for_each_pair(Check check) {
    int checked = 0;
    const Device device = test::device_on(backend());
    for (int seed = 0; seed < 20 && checked < pairs_to_check; ++seed) {
      const Model model = untrained_model(network().config, seed).value();
      Plan exact = test::plan_for(model, {.precision = Precision::f64, .mode = {}});
      Plan plan = test::plan_for(model, {}, device, {.pairs = 1, .points = 600});
      for (int draw = 0; draw < 2; ++draw) {
        const ExactCloud source = test::exact_cloud(random_, 300),
                         reference = test::exact_cloud(random_, 257);
        const Assembly truth = solve(exact, source.view(), reference.view());
        if (truth.diagnostics.rotation_gap < least_gap) continue;
        const auto& t = truth.T_reference_source.translation;
        const double extent = test::size_of(source) + test::size_of(reference) + std::hypot(t[0], t[1], t[2]);
        check(plan, source, reference, truth.T_reference_source, extent);
        ++checked;
      }
    }
    EXPECT_GE(checked, pairs_to_check);
  }
  Random random_{77};
  test::Residuals residuals_;
};

TEST_P(FloatProperty, AgreesWithDouble) {
  for_each_pair(
      [&](Plan& plan, const ExactCloud& source, const ExactCloud& reference, const Pose& f, double extent) {
        residuals_.expect_near(solve(plan, source.view(), reference.view()).T_reference_source, f, extent,
                               bound_f32, "");
      });
}

TEST_P(FloatProperty, MovesWithBothClouds) {
  for_each_pair(
      [&](Plan& plan, const ExactCloud& source, const ExactCloud& reference, const Pose&, double extent) {
        const Pose f = solve(plan, source.view(), reference.view()).T_reference_source;
        const Pose g1 = test::random_pose(random_), g2 = test::random_pose(random_);
        const ExactCloud x = test::moved(source, g1), y = test::moved(reference, g2);
        residuals_.expect_near(solve(plan, x.view(), y.view()).T_reference_source, g2 * f * g1.inverse(),
                               extent, bound_f32, "");
      });
}

TEST_P(FloatProperty, ExchangedCloudsGiveTheInverse) {
  for_each_pair(
      [&](Plan& plan, const ExactCloud& source, const ExactCloud& reference, const Pose&, double extent) {
        const Pose f = solve(plan, source.view(), reference.view()).T_reference_source;
        residuals_.expect_near(solve(plan, reference.view(), source.view()).T_reference_source, f.inverse(),
                               extent, bound_f32, "");
      });
}

TEST_P(FloatProperty, ScalesWithTheClouds) {
  for_each_pair(
      [&](Plan& plan, const ExactCloud& source, const ExactCloud& reference, const Pose&, double extent) {
        for (const double c : {1e-3, 3.7, 1e3}) {
          Pose f = solve(plan, source.view(), reference.view()).T_reference_source;
          for (double& t : f.translation) t *= c;
          const ExactCloud x = test::scaled(source, c), y = test::scaled(reference, c);
          residuals_.expect_near(solve(plan, x.view(), y.view()).T_reference_source, f, c * extent, bound_f32,
                                 "scale " + std::to_string(c));
        }
      });
}

TEST_P(FloatProperty, ForgetsTheOrderOfPoints) {
  for_each_pair(
      [&](Plan& plan, const ExactCloud& source, const ExactCloud& reference, const Pose&, double extent) {
        const Pose f = solve(plan, source.view(), reference.view()).T_reference_source;
        const ExactCloud x = test::shuffled(source, random_), y = test::shuffled(reference, random_);
        residuals_.expect_near(solve(plan, x.view(), y.view()).T_reference_source, f, extent, bound_f32, "");
      });
}

TEST_P(FloatProperty, CompleteMatchingNeedsNoTraining) {
  for_each_pair([&](Plan& plan, const ExactCloud& source, const ExactCloud&, const Pose&, double) {
    const Pose g = test::random_pose(random_);
    const ExactCloud copy = test::moved(source, g);
    const Assembly half = solve(plan, source.view(), copy.view());
    if (half.diagnostics.rotation_gap < least_gap) return;
    const auto& t = half.T_reference_source.translation;
    const Pose found = solve(plan, source.view(), copy.view(), {.complete_match = true}).T_reference_source;
    residuals_.expect_near(found, g, 2 * test::size_of(source) + std::hypot(t[0], t[1], t[2]), bound_f32, "");
  });
}

TEST_P(FloatProperty, LargeCoordinatesLoseNothing) {
  constexpr std::array<double, 9> unturned = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  const Pose far1{unturned, {1e6, -2e6, 5e5}}, far2{unturned, {-3e6, 0, 1e6}};
  for_each_pair(
      [&](Plan& plan, const ExactCloud& source, const ExactCloud& reference, const Pose& f, double extent) {
        const ExactCloud x = test::moved(source, far1), y = test::moved(reference, far2);
        const Pose moved = solve(plan, x.view(), y.view()).T_reference_source;
        residuals_.expect_near(far2.inverse() * moved * far1, f, extent, bound_f32, "");
      });
}

INSTANTIATE_TEST_SUITE_P(Networks, FloatProperty,
                         testing::Combine(testing::ValuesIn(test::networks()),
                                          testing::Values(Backend::cpu, Backend::vulkan)),
                         [](const auto& kind) {
                           return std::string(std::get<0>(kind.param).name) + "_" +
                                  std::string(name(std::get<1>(kind.param)));
                         });

}  // namespace
}  // namespace bitr
