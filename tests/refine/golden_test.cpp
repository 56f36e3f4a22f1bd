// The official code's refinements, step by step and to the end.
#include <gtest/gtest.h>

#include <algorithm>
#include <bitr/refine.hpp>
#include <cmath>

#include "refine/transport.hpp"
#include "support/golden_refinement.hpp"

namespace bitr {
namespace {

using test::GoldenRefinement;

Refinement run(const GoldenRefinement& golden, RefineMethod method, std::optional<int> most_iterations = {},
               const Device& device = cpu_device(2)) {
  const PointCloud source = golden.cloud("src"), reference = golden.cloud("ref");
  const CloudPair pair = {source, reference};
  const Pose start = golden.pose("_init");
  auto refined = refine_poses(
      device, {&pair, 1}, {&start, 1},
      {.method = method, .protocol = RefineProtocol::official, .most_iterations = most_iterations});
  EXPECT_TRUE(refined) << (refined ? "" : refined.error().message);
  return refined->front();
}

void expect_near(const Pose& pose, const Pose& official) {
  EXPECT_LE(rotation_error_degrees(pose, official), 1e-8);
  EXPECT_LE(translation_error(pose, official), 1e-10);
}

TEST(RefineGolden, Icp) {
  for (const char* name : {"icp0", "icp1"}) {
    const GoldenRefinement golden(name);
    expect_near(run(golden, RefineMethod::icp, 1).proposal, golden.pose("_after1"));
    const Refinement last = run(golden, RefineMethod::icp);
    expect_near(last.proposal, golden.pose(""));
    EXPECT_EQ(last.iterations, static_cast<int>(golden.values("iters")[0])) << name;
    EXPECT_TRUE(last.converged);
  }
}

TEST(RefineGolden, OptimalTransport) {
  const GoldenRefinement golden("ot0");
  expect_near(run(golden, RefineMethod::transport, 1).proposal, golden.pose("_after1"));
  const Refinement last = run(golden, RefineMethod::transport);
  expect_near(last.proposal, golden.pose(""));
  EXPECT_EQ(last.iterations, 79);  // the official code counts from 0 and says 78
  EXPECT_TRUE(last.converged);
}

TEST(RefineGolden, TheFirstTransportPlan) {
  const GoldenRefinement golden("ot0");
  const PointCloud source = golden.cloud("src"), reference = golden.cloud("ref");
  refine::Sinkhorn plan({source.positions, {}, 0}, {reference.positions, {}, 0}, {});
  plan.move_source(golden.pose("_init"));
  EXPECT_EQ(plan.normalise({}, {}), 200);
  const std::vector<double> logs = golden.values("first_sinkhorn_logperm");
  for (std::size_t i = 0; i < source.size(); i += 3)
    for (std::size_t j = 0; j < reference.size(); ++j)
      EXPECT_NEAR(plan.log_plan(i, j), logs[i * reference.size() + j], 1e-9) << i << ", " << j;
  Eigen::ArrayXd weights;
  Eigen::ArrayXXd targets;
  plan.project(weights, targets);
  const std::vector<double> sums = golden.values("perm_rowsum");
  for (std::size_t row = 0; row < sums.size(); ++row)
    EXPECT_NEAR(weights[static_cast<Eigen::Index>(row)], sums[plan.source().order()[row]], 1e-12);
}

}  // namespace
}  // namespace bitr
