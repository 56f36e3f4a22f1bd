// What must never be returned as if it were fine, and what far-away clouds must not lose.
#include <gtest/gtest.h>

#include <bitr/assemble.hpp>
#include <cmath>

#include "api/internal.hpp"
#include "model/load.hpp"
#include "model/weights.hpp"
#include "property/network.hpp"

namespace bitr {
namespace {

PointCloud random_cloud(Random& random, std::size_t count, double offset = 0) {
  PointCloud cloud;
  for (std::size_t i = 0; i < count; ++i)
    cloud.positions.push_back(
        {offset + random.normal(), offset + 0.7 * random.normal(), offset + 0.4 * random.normal()});
  return cloud;
}

class Failing : public testing::TestWithParam<Backend> {
 protected:
  void SetUp() override { BITR_NEEDS(GetParam()); }
};

Assembly assemble_one(Backend backend, const Model& model, const CloudPair& pair,
                      const AssembleOptions& options) {
  auto plan = make_plan(test::device_on(backend), model, shape_of({&pair, 1}));
  EXPECT_TRUE(plan) << plan.error().message;
  auto assemblies = assemble(*plan, {&pair, 1}, options);
  EXPECT_TRUE(assemblies) << assemblies.error().message;
  return assemblies->front();
}

TEST_P(Failing, NumbersThatOverflowInTheNetworkMarkThePoseAsFailed) {
  Random random(1);
  for (const std::size_t points : {60, 900}) {
    auto weights = model::initial_weights({}, 0, Mode::scale_exact);
    for (auto& [name, matrix] : weights.parameters) matrix *= 1e30;
    const Model model = Internal::model(std::make_shared<const model::Weights>(std::move(weights)));
    const PointCloud source = random_cloud(random, points), reference = random_cloud(random, points);
    const Assembly assembly = assemble_one(GetParam(), model, {source, reference}, {});
    EXPECT_EQ(assembly.status, Status::failed);
    EXPECT_TRUE(assembly.diagnostics.degenerate);
    EXPECT_FALSE(assembly.diagnostics.reason.empty());
    for (double x : assembly.T_reference_source.rotation) EXPECT_TRUE(std::isnan(x));
  }
}

TEST_P(Failing, RotationsAreOrthonormalInDoubleWhateverThePlansPrecision) {
  Random random(2);
  const Model model = untrained_model().value();
  const PointCloud source = random_cloud(random, 200), reference = random_cloud(random, 150);
  const Pose pose = assemble_one(GetParam(), model, {source, reference}, {}).T_reference_source;
  const Pose identity = pose * pose.inverse();
  for (int i = 0; i < 9; ++i) EXPECT_NEAR(identity.rotation[i], i % 4 == 0 ? 1 : 0, 1e-13);
}

TEST_P(Failing, FarAwayCloudsKeepTheirSwapResidual) {
  Random random(3);
  const Model model = untrained_model().value();
  const PointCloud source = random_cloud(random, 200, 5e6), reference = random_cloud(random, 200, -4e6);
  const Assembly assembly = assemble_one(GetParam(), model, {source, reference}, {.swap_residual = true});
  EXPECT_LE(assembly.diagnostics.swap_residual.value(), 1e-3);
}

TEST_P(Failing, ExtentsBeyondThePrecisionAreRefused) {
  Random random(4);
  const Model model = untrained_model().value();
  for (const double scale : {1e-18, 1e20, 1e300}) {
    PointCloud cloud = random_cloud(random, 100);
    for (Vec3d& p : cloud.positions)
      for (double& x : p) x *= scale;
    const CloudPair pair{cloud, cloud};
    auto plan = make_plan(test::device_on(GetParam()), model, shape_of({&pair, 1}));
    const auto assemblies = assemble(*plan, {&pair, 1});
    ASSERT_FALSE(assemblies);
    EXPECT_EQ(assemblies.error().code, ErrorCode::invalid_argument);
    EXPECT_NE(assemblies.error().message.find("extent"), std::string::npos) << assemblies.error().message;
  }
}

TEST_P(Failing, ViewsWithoutDataOrWithOverlappingRowsAreRefused) {
  Random random(5);
  const Model model = untrained_model().value();
  const PointCloud cloud = random_cloud(random, 100);
  const Vec3View good(cloud.positions);
  for (const Vec3View& bad : {Vec3View(nullptr, 100, sizeof(Vec3d), Scalar::f64),
                              Vec3View(cloud.positions.data(), 100, 8, Scalar::f64)}) {
    const CloudPair pair{CloudView(bad), CloudView(good)};
    auto plan = make_plan(test::device_on(GetParam()), model, shape_of({&pair, 1}));
    const auto assemblies = assemble(*plan, {&pair, 1});
    ASSERT_FALSE(assemblies);
    EXPECT_NE(assemblies.error().message.find("stride"), std::string::npos) << assemblies.error().message;
  }
}

TEST_P(Failing, MoreThanMemoryIsAnErrorNotAnException) {
  const auto plan =
      make_plan(test::device_on(GetParam()), untrained_model().value(), {1, std::size_t{1} << 40});
  ASSERT_FALSE(plan);
  EXPECT_EQ(plan.error().code, ErrorCode::invalid_argument);
}

INSTANTIATE_TEST_SUITE_P(Backends, Failing, testing::Values(Backend::cpu, Backend::vulkan),
                         [](const auto& kind) { return std::string(name(kind.param)); });

}  // namespace
}  // namespace bitr
