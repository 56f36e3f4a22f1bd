// The official code's refinements, step by step and to the end.
#include <gtest/gtest.h>

#include <algorithm>
#include <bitr/refine.hpp>
#include <cmath>

#include "refine/transport.hpp"
#include "support/golden.hpp"

namespace bitr {
namespace {

class Refinements {
 public:
  explicit Refinements(std::string name) : name_(std::move(name)) {}
  std::vector<double> values(const std::string& suffix) const {
    return tensors_.tensors.at(name_ + "." + suffix).to_double();
  }
  PointCloud cloud(const std::string& suffix) const {
    const std::vector<double> flat = values(suffix);
    PointCloud cloud;
    cloud.positions.resize(flat.size() / 3);
    for (std::size_t i = 0; i < flat.size(); ++i) cloud.positions[i / 3][i % 3] = flat[i];
    return cloud;
  }
  Pose pose(const std::string& suffix) const {
    const std::vector<double> R = values("R" + suffix), t = values("t" + suffix);
    Pose pose;
    std::copy(R.begin(), R.end(), pose.rotation.begin());
    std::copy(t.begin(), t.end(), pose.translation.begin());
    return pose;
  }
  Refinement run(RefineMethod method, std::optional<int> most_iterations = {}) const {
    const PointCloud source = cloud("src"), reference = cloud("ref");
    const CloudPair pair = {source, reference};
    const Pose start = pose("_init");
    auto refined = refine_poses(
        cpu_device(2), {&pair, 1}, {&start, 1},
        {.method = method, .protocol = RefineProtocol::official, .most_iterations = most_iterations});
    EXPECT_TRUE(refined) << (refined ? "" : refined.error().message);
    return refined->front();
  }

 private:
  std::string name_;
  TensorMap tensors_ = test::read_tensors(test::golden_path("refine.safetensors"));
};

void expect_near(const Pose& pose, const Pose& official) {
  EXPECT_LE(rotation_error_degrees(pose, official), 1e-8);
  EXPECT_LE(translation_error(pose, official), 1e-10);
}

TEST(RefineGolden, Icp) {
  for (const char* name : {"icp0", "icp1"}) {
    const Refinements golden(name);
    expect_near(golden.run(RefineMethod::icp, 1).proposal, golden.pose("_after1"));
    const Refinement last = golden.run(RefineMethod::icp);
    expect_near(last.proposal, golden.pose(""));
    EXPECT_EQ(last.iterations, static_cast<int>(golden.values("iters")[0])) << name;
    EXPECT_TRUE(last.converged);
  }
}

TEST(RefineGolden, OptimalTransport) {
  const Refinements golden("ot0");
  expect_near(golden.run(RefineMethod::transport, 1).proposal, golden.pose("_after1"));
  const Refinement last = golden.run(RefineMethod::transport);
  expect_near(last.proposal, golden.pose(""));
  EXPECT_EQ(last.iterations, 79);  // the official code counts from 0 and says 78
  EXPECT_TRUE(last.converged);
}

TEST(RefineGolden, TheFirstTransportPlan) {
  const Refinements golden("ot0");
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
