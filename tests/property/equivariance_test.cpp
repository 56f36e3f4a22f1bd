// What the network promises by construction, for weights nobody trained: in double precision to rounding, in
// float to what float can hold.
#include <array>
#include <cmath>

#include "property/network.hpp"

namespace bitr {
namespace {

using test::ExactCloud;
using test::Network;
using test::Residuals;
using test::solve;

// Rotation entries, and translations relative to the clouds and to the translation itself.
constexpr double bound_f64 = 1e-8;

struct Pair {
  ExactCloud source, reference;
};

// Sizes from the smallest a model takes to a few hundred, source and reference unequal.
std::vector<Pair> random_pairs(const ModelConfig& config, Random& random) {
  const std::size_t least = test::least_points(config);
  const std::size_t sizes[][2] = {{least, least}, {least, least + 1}, {2 * least + 3, least}, {150, 261}};
  std::vector<Pair> pairs;
  for (const auto& [n, m] : sizes)
    pairs.push_back({test::exact_cloud(random, n), test::exact_cloud(random, m)});
  return pairs;
}

double extent(const Pair& pair, const Pose& pose) {
  const auto& t = pose.translation;
  return test::size_of(pair.source) + test::size_of(pair.reference) + std::hypot(t[0], t[1], t[2]);
}

class Property : public testing::TestWithParam<std::tuple<Network, int>> {
 protected:
  const ModelConfig& config() const { return std::get<0>(GetParam()).config; }
  int seed() const { return std::get<1>(GetParam()); }
  Model model(Mode mode = Mode::scale_exact) const { return untrained_model(config(), seed(), mode).value(); }
  Plan plan(Mode mode = Mode::scale_exact) const {
    return test::plan_for(model(mode), {.precision = Precision::f64, .mode = {}});
  }
  Random random_{static_cast<std::uint64_t>(1000 + std::get<1>(GetParam()))};
  Residuals residuals_;
};

TEST_P(Property, MovesWithBothClouds) {
  for (const Mode mode : {Mode::scale_exact, Mode::reference}) {
    Plan plan = this->plan(mode);
    for (const Pair& pair : random_pairs(config(), random_)) {
      const Pose g1 = test::random_pose(random_), g2 = test::random_pose(random_);
      const Pose f = solve(plan, pair.source.view(), pair.reference.view()).T_reference_source;
      const ExactCloud source = test::moved(pair.source, g1), reference = test::moved(pair.reference, g2);
      const Pose moved = solve(plan, source.view(), reference.view()).T_reference_source;
      residuals_.expect_near(moved, g2 * f * g1.inverse(), extent(pair, f), bound_f64,
                             std::to_string(pair.source.size()) + " points");
    }
  }
}

TEST_P(Property, ExchangedCloudsGiveTheInverse) {
  Plan plan = this->plan();
  for (const Pair& pair : random_pairs(config(), random_)) {
    const Pose f = solve(plan, pair.source.view(), pair.reference.view()).T_reference_source;
    const Assembly back = solve(plan, pair.reference.view(), pair.source.view(), {.swap_residual = true});
    residuals_.expect_near(back.T_reference_source, f.inverse(), extent(pair, f), bound_f64, "swap");
    ASSERT_TRUE(back.diagnostics.swap_residual);
    EXPECT_LE(*back.diagnostics.swap_residual, 10 * bound_f64 * extent(pair, f));
  }
}

TEST_P(Property, ScalesWithTheClouds) {
  Plan plan = this->plan();
  for (const Pair& pair : random_pairs(config(), random_))
    for (const double c : {1e-3, 0.02, 3.7, 1e3}) {
      Pose f = solve(plan, pair.source.view(), pair.reference.view()).T_reference_source;
      const double size = c * extent(pair, f);
      for (double& t : f.translation) t *= c;
      const ExactCloud source = test::scaled(pair.source, c), reference = test::scaled(pair.reference, c);
      residuals_.expect_near(solve(plan, source.view(), reference.view()).T_reference_source, f, size,
                             bound_f64, "scale " + std::to_string(c));
    }
}

TEST_P(Property, ForgetsTheOrderOfPoints) {
  Plan plan = this->plan();
  for (const Pair& pair : random_pairs(config(), random_)) {
    const Assembly f = solve(plan, pair.source.view(), pair.reference.view());
    const ExactCloud source = test::shuffled(pair.source, random_),
                     reference = test::shuffled(pair.reference, random_);
    const Assembly g = solve(plan, source.view(), reference.view());
    // To the last bit: plans put points into an order of their own.
    EXPECT_EQ(g.T_reference_source.rotation, f.T_reference_source.rotation);
    EXPECT_EQ(g.T_reference_source.translation, f.T_reference_source.translation);
    // A key point's index is a channel, not a point.
    EXPECT_EQ(g.source_key_points, f.source_key_points);
    EXPECT_EQ(g.reference_key_points, f.reference_key_points);
  }
}

TEST_P(Property, CompleteMatchingNeedsNoTraining) {
  Plan plan = this->plan();
  for (const Pair& pair : random_pairs(config(), random_)) {
    const Pose g = test::random_pose(random_);
    const ExactCloud copy = test::shuffled(test::moved(pair.source, g), random_);
    const Pose half = solve(plan, pair.source.view(), copy.view()).T_reference_source;
    const Assembly found =
        solve(plan, pair.source.view(), copy.view(), {.complete_match = true, .diagnostics = true});
    residuals_.expect_near(found.T_reference_source, g, extent(pair, half), bound_f64, "complete matching");
    EXPECT_EQ(found.diagnostics.overlap, 1.0);
  }
}

// The network without folding, in the official mode, keeps what does not need eps = 0.
TEST_P(Property, AsDefinedMovesWithBothClouds) {
  Plan plan =
      test::plan_for(model(Mode::reference), {.precision = Precision::f64, .mode = {}, .as_defined = true});
  const std::size_t least = test::least_points(config());
  const Pair pair{test::exact_cloud(random_, least), test::exact_cloud(random_, least + 5)};
  const Pose g1 = test::random_pose(random_), g2 = test::random_pose(random_);
  const Pose f = solve(plan, pair.source.view(), pair.reference.view()).T_reference_source;
  const ExactCloud source = test::moved(pair.source, g1), reference = test::moved(pair.reference, g2);
  residuals_.expect_near(solve(plan, source.view(), reference.view()).T_reference_source,
                         g2 * f * g1.inverse(), extent(pair, f), bound_f64, "as defined");
  residuals_.expect_near(solve(plan, pair.reference.view(), pair.source.view()).T_reference_source,
                         f.inverse(), extent(pair, f), bound_f64, "swap");
}

// Far from the origin only the coordinates' own digits are lost: 1e6 leaves 1e-10.
TEST_P(Property, LargeCoordinatesLoseNothing) {
  Plan plan = this->plan();
  constexpr std::array<double, 9> unturned = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  const Pose far1{unturned, {1e6, -2e6, 5e5}}, far2{unturned, {-3e6, 0, 1e6}};
  for (Pair& pair : random_pairs(config(), random_)) {
    // Coordinates that stay exact far away, so that only the library can lose digits.
    for (ExactCloud* cloud : {&pair.source, &pair.reference})
      for (Vec3d& p : cloud->positions)
        for (double& x : p) x = std::round(x * 0x1p20) * 0x1p-20;
    const ExactCloud source = test::moved(pair.source, far1), reference = test::moved(pair.reference, far2);
    const Pose f = solve(plan, pair.source.view(), pair.reference.view()).T_reference_source;
    const Pose moved = solve(plan, source.view(), reference.view()).T_reference_source;
    residuals_.expect_near(far2.inverse() * moved * far1, f, extent(pair, f), bound_f64, "far away");
  }
}

INSTANTIATE_TEST_SUITE_P(Networks, Property,
                         testing::Combine(testing::ValuesIn(test::networks()), testing::Values(0, 1, 2)),
                         [](const auto& kind) {
                           return std::string(std::get<0>(kind.param).name) + "_" +
                                  std::to_string(std::get<1>(kind.param));
                         });

}  // namespace
}  // namespace bitr
