// Refinement on a Vulkan device: what the CPU's gives, for any sizes and any number of pairs at once.
#include <gtest/gtest.h>

#include <bitr/generate.hpp>
#include <bitr/refine.hpp>
#include <cmath>
#include <memory>

#include "api/internal.hpp"
#include "core/thread_pool.hpp"
#include "refine/vulkan_plans.hpp"
#include "support/golden_refinement.hpp"
#include "support/random_motion.hpp"
#include "support/vulkan.hpp"

namespace bitr {
namespace {

class RefineVulkan : public testing::Test {
 protected:
  void SetUp() override {
    if (!test::vulkan()) GTEST_SKIP() << "no Vulkan device";
    device_ = Internal::device(std::make_shared<ThreadPool>(2), test::vulkan());
  }
  const Device& device() const { return *device_; }

 private:
  std::optional<Device> device_;
};

struct Pairs {
  std::vector<std::unique_ptr<PointCloud>> clouds;
  std::vector<CloudPair> pairs;
  std::vector<Pose> starts;
  void add(PointCloud source, PointCloud reference, const Pose& start) {
    clouds.push_back(std::make_unique<PointCloud>(std::move(source)));
    clouds.push_back(std::make_unique<PointCloud>(std::move(reference)));
    pairs.push_back({*clouds[clouds.size() - 2], *clouds.back()});
    starts.push_back(start);
  }
};

/// A cloud without symmetry, parts of two samples of it, and a start a little off.
void add_pair(Pairs& pairs, Random& random, std::size_t source_points, std::size_t reference_points,
              bool normals, double scale = 1) {
  const auto seed = random.below(1000);
  const Pose truth = test::random_pose(random, scale);
  const auto sample = [&](std::size_t points, std::size_t of, const Pose& motion) {
    PointCloud cloud = generate_shape("aircraft", seed, of).value().cloud;
    cloud.positions.resize(points);
    for (Vec3d& point : cloud.positions) {
      for (double& x : point) x = scale * (x + 0.003 * random.normal());
      point = motion.apply(point);
    }
    cloud.normals.resize(normals ? points : 0);
    for (Vec3f& n : cloud.normals) {
      const Vec3d turned = motion.rotate({n[0], n[1], n[2]});
      n = {static_cast<float>(turned[0]), static_cast<float>(turned[1]), static_cast<float>(turned[2])};
    }
    return cloud;
  };
  Pose off = test::random_pose(random, 0.01 * scale);
  const double c = std::cos(0.12), s = std::sin(0.12);
  off.rotation = {c, -s, 0, s, c, 0, 0, 0, 1};
  const std::size_t of = std::max({source_points, reference_points, std::size_t{8}});
  pairs.add(sample(source_points, of, {}), sample(reference_points, of + of / 5, truth), truth * off);
}

std::vector<Refinement> refined(const Device& device, const Pairs& pairs, const RefineOptions& options) {
  auto results = refine_poses(device, pairs.pairs, pairs.starts, options);
  EXPECT_TRUE(results) << (results ? "" : results.error().message);
  return results ? std::move(*results) : std::vector<Refinement>(pairs.pairs.size());
}

void expect_equal(const Refinement& vulkan, const Refinement& cpu, const std::string& which) {
  EXPECT_LE(rotation_error_degrees(vulkan.proposal, cpu.proposal), 1e-3) << which;
  EXPECT_LE(translation_error(vulkan.proposal, cpu.proposal), 1e-4 * cpu.spacing) << which;
  EXPECT_NEAR(vulkan.iterations, cpu.iterations, 1) << which;
  EXPECT_NEAR(vulkan.score_before, cpu.score_before, 1e-6) << which;
  EXPECT_NEAR(vulkan.score_after, cpu.score_after, 1e-5) << which;
  EXPECT_EQ(vulkan.improved, cpu.improved) << which;
  EXPECT_EQ(vulkan.reason.empty(), cpu.reason.empty()) << which;
  EXPECT_GE(vulkan.improved ? vulkan.score_after : vulkan.score_before, vulkan.score_before) << which;
}

TEST_F(RefineVulkan, IcpIsTheOfficialCodes) {
  for (const char* name : {"icp0", "icp1"}) {
    const test::GoldenRefinement golden(name);
    Pairs pairs;
    pairs.add(golden.cloud("src"), golden.cloud("ref"), golden.pose("_init"));
    const Refinement result = refined(device(), pairs, {.protocol = RefineProtocol::official}).front();
    EXPECT_LE(rotation_error_degrees(result.proposal, golden.pose("")), 1e-3) << name;
    EXPECT_LE(translation_error(result.proposal, golden.pose("")), 1e-5) << name;
    EXPECT_NEAR(result.iterations, golden.values("iters")[0], 1) << name;
  }
}

TEST_F(RefineVulkan, TransportIsTheOfficialCodes) {
  const test::GoldenRefinement golden("ot0");
  refine::Sinkhorn plan({golden.cloud("src").positions, {}, 0}, {golden.cloud("ref").positions, {}, 0}, {});
  plan.move_source(golden.pose("_init"));
  EXPECT_TRUE(refine::VulkanPlans::fits({plan, {}, false, {}, {}}));
  Pairs pairs;
  pairs.add(golden.cloud("src"), golden.cloud("ref"), golden.pose("_init"));
  RefineOptions options{.method = RefineMethod::transport, .protocol = RefineProtocol::official};
  const Refinement last = refined(device(), pairs, options).front();
  EXPECT_LE(rotation_error_degrees(last.proposal, golden.pose("")), 1e-3);
  EXPECT_LE(translation_error(last.proposal, golden.pose("")), 1e-5);
  EXPECT_NEAR(last.iterations, 79, 1);
  options.most_iterations = 1;
  const Refinement first = refined(device(), pairs, options).front();
  EXPECT_LE(rotation_error_degrees(first.proposal, golden.pose("_after1")), 1e-3);
}

// One after the other on the CPU, together on the device.
TEST_F(RefineVulkan, PlansAreTheCpus) {
  Random random(7);
  const auto points = [&](std::size_t count) {
    std::vector<Vec3d> rows(count);
    for (Vec3d& row : rows)
      for (double& x : row) x = random.uniform(-0.5, 0.5);
    return rows;
  };
  const auto directions = [&](std::size_t count) {
    std::vector<Vec3d> rows(count);
    for (Vec3d& row : rows)
      for (Eigen::Index a = 0; a < 3; ++a) row[a] = test::random_unit(random)[a];
    return rows;
  };
  ThreadPool pool(2);
  refine::VulkanPlans plans(*test::vulkan(), pool);
  for (const double beta : {3.0, 100.0, 5000.0}) {
    std::vector<std::unique_ptr<refine::Sinkhorn>> cpu, vulkan;
    std::vector<std::unique_ptr<refine::TransportStage>> stages;
    for (const auto& [n, m, length] : {std::tuple{3, 3, 0.0},
                                       {3, 65, 0.3},
                                       {63, 64, 0.0},
                                       {65, 5, 0.0},
                                       {64, 128, 0.2},
                                       {129, 63, 0.0},
                                       {400, 300, 0.1},
                                       {300, 700, 0.0}}) {
      const auto X = points(n), Y = points(m);
      const auto NX = directions(length > 0 ? n : 0), NY = directions(length > 0 ? m : 0);
      stages.push_back(std::make_unique<refine::TransportStage>());
      *stages.back() = {.affinity = {.beta = beta, .alpha = random.uniform(0, 0.5)},
                        .normal_length = length,
                        .sinkhorn = {.most_iterations = 60, .tolerance = 1e-3}};
      for (auto* made : {&cpu, &vulkan})
        made->push_back(std::make_unique<refine::Sinkhorn>(
            refine::BlockedPoints(X, NX, length), refine::BlockedPoints(Y, NY, length), refine::Workers{}));
    }
    for (const bool warm : {false, true}) {
      std::vector<refine::PlanWanted> expected, wanted;
      std::vector<refine::PlanWanted*> all;
      for (std::size_t i = 0; i < cpu.size(); ++i) {
        expected.push_back({*cpu[i], *stages[i], warm, {}, {}});
        wanted.push_back({*vulkan[i], *stages[i], warm, {}, {}});
      }
      for (refine::PlanWanted& each : wanted) {
        EXPECT_TRUE(refine::VulkanPlans::fits(each));
        all.push_back(&each);
      }
      plans.run(all);
      for (std::size_t i = 0; i < cpu.size(); ++i) {
        refine::solve(expected[i]);
        const std::string which = "beta " + std::to_string(beta) + ", plan " + std::to_string(i);
        EXPECT_LE((wanted[i].weights - expected[i].weights).abs().maxCoeff(), 1e-5) << which;
        EXPECT_LE((wanted[i].targets - expected[i].targets).abs().maxCoeff(), 1e-5) << which;
      }
    }
  }
}

TEST_F(RefineVulkan, TwentyThousandPointsEachInLinearMemory) {
  Random random(4);
  std::vector<Vec3d> points(20'000);
  for (Vec3d& point : points)
    for (double& x : point) x = random.uniform(-0.5, 0.5);
  ThreadPool pool(2);
  refine::VulkanPlans plans(*test::vulkan(), pool);
  const refine::TransportStage stage{.affinity = {.beta = 5000, .alpha = 0.002},
                                     .sinkhorn = {.most_iterations = 2}};
  refine::Sinkhorn plan({points, {}, 0}, {points, {}, 0}, {}),
      same({points, {}, 0}, {points, {}, 0}, {&pool});
  refine::PlanWanted wanted{plan, stage, false, {}, {}}, expected{same, stage, false, {}, {}};
  refine::PlanWanted* one = &wanted;
  plans.run({&one, 1});
  EXPECT_LE(plans.bytes(), points.size() * 2 * 300);
  refine::solve(expected);
  EXPECT_LE((wanted.weights - expected.weights).abs().maxCoeff(), 1e-5);
}

TEST_F(RefineVulkan, EqualsTheCpu) {
  Random random(1);
  Pairs pairs;
  for (const auto& [n, m, normals] : {std::tuple{3, 3, false},
                                      {3, 65, true},
                                      {31, 5, true},
                                      {33, 32, false},
                                      {63, 64, true},
                                      {64, 65, false},
                                      {65, 300, true},
                                      {900, 257, false},
                                      {1500, 2200, true},
                                      {4500, 3000, true}})
    add_pair(pairs, random, n, m, normals, std::exp(random.uniform(-3, 3)));
  for (const RefineProtocol protocol : {RefineProtocol::adaptive, RefineProtocol::official})
    for (const double overlap : {0.0, 0.2}) {
      const RefineOptions options{.protocol = protocol, .least_overlap = overlap};
      const auto vulkan = refined(device(), pairs, options);
      const auto cpu = refined(cpu_device(2), pairs, options);
      for (std::size_t i = 0; i < cpu.size(); ++i)
        expect_equal(vulkan[i], cpu[i], "pair " + std::to_string(i) + ", " + std::string(name(protocol)));
    }
}

TEST_F(RefineVulkan, TransportEqualsTheCpu) {
  Random random(5);
  Pairs pairs;
  for (const auto& [n, m, normals] :
       {std::tuple{3, 5, false}, {64, 65, true}, {150, 63, false}, {300, 420, true}})
    add_pair(pairs, random, n, m, normals);
  for (const RefineProtocol protocol : {RefineProtocol::adaptive, RefineProtocol::official}) {
    const bool official = protocol == RefineProtocol::official;
    const RefineOptions options{.method = RefineMethod::transport,
                                .protocol = protocol,
                                .least_overlap = 0,
                                .most_iterations = official ? 8 : 10};
    const auto vulkan = refined(device(), pairs, options);
    const auto cpu = refined(cpu_device(2), pairs, options);
    for (std::size_t i = 0; i < cpu.size(); ++i)
      expect_equal(vulkan[i], cpu[i], "pair " + std::to_string(i) + ", " + std::string(name(protocol)));
  }
}

TEST_F(RefineVulkan, BatchesChangeNothing) {
  Random random(2);
  Pairs pairs;
  for (int i = 0; i < 7; ++i) add_pair(pairs, random, 30 + random.below(400), 30 + random.below(400), i % 2);
  for (const RefineMethod method : {RefineMethod::icp, RefineMethod::transport}) {
    const RefineOptions options{.method = method};
    const auto together = refined(device(), pairs, options);
    const auto some =
        refine_poses(device(), std::span(pairs.pairs).first(3), std::span(pairs.starts).first(3), options)
            .value();
    for (std::size_t i = 0; i < together.size(); ++i) {
      const auto alone = refine_poses(device(), {&pairs.pairs[i], 1}, {&pairs.starts[i], 1}, options).value();
      for (const Refinement* other : {&alone.front(), i < some.size() ? &some[i] : &alone.front()}) {
        EXPECT_EQ(together[i].proposal.rotation, other->proposal.rotation) << i;
        EXPECT_EQ(together[i].proposal.translation, other->proposal.translation) << i;
        EXPECT_EQ(together[i].score_after, other->score_after) << i;
        EXPECT_EQ(together[i].iterations, other->iterations) << i;
      }
    }
  }
}

TEST_F(RefineVulkan, FromWhereverItStarts) {
  Random random(3);
  Pairs pairs;
  for (int i = 0; i < 60; ++i) {
    add_pair(pairs, random, 20 + random.below(60), 20 + random.below(60), i % 2);
    // Some from so far away that single precision no longer tells points apart.
    pairs.starts.back() = test::random_pose(random, i % 3 == 0 ? 1e9 : 0.5);
  }
  for (const RefineProtocol protocol : {RefineProtocol::adaptive, RefineProtocol::official}) {
    const RefineOptions options{.protocol = protocol, .least_overlap = 0, .most_iterations = 30};
    const auto vulkan = refined(device(), pairs, options);
    for (std::size_t i = 0; i < vulkan.size(); ++i) {
      const double score = refinement_score(device(), pairs.pairs[i], vulkan[i].T_reference_source).value();
      EXPECT_GE(vulkan[i].improved ? vulkan[i].score_after : vulkan[i].score_before, vulkan[i].score_before);
      EXPECT_NEAR(
          score, refinement_score(cpu_device(1), pairs.pairs[i], vulkan[i].T_reference_source).value(), 1e-6);
    }
  }
}

TEST_F(RefineVulkan, ManyPointsAtOnePlace) {
  PointCloud source, reference;
  source.positions.assign(3000, {1, 2, 3});
  reference.positions.assign(5000, {1, 2, 3});
  for (int i = 0; i < 100; ++i) {
    source.positions.push_back({1 + 0.01 * i, 2, 3});
    reference.positions.push_back({1, 2 + 0.01 * i, 3});
  }
  Pairs pairs;
  pairs.add(source, reference, {});
  // More than the device looks at: the host does.
  PointCloud few, crowd;
  few.positions = {{0.1, 0, 0}, {0, 0.2, 0}, {0, 0, 0.3}, {0.2, 0.1, 0}};
  crowd.positions.assign(200'000, {0, 0, 0});
  crowd.positions.push_back({1, 1, 1});
  pairs.add(few, crowd, {});
  for (const RefineProtocol protocol : {RefineProtocol::adaptive, RefineProtocol::official}) {
    const RefineOptions options{.protocol = protocol, .least_overlap = 0, .most_iterations = 3};
    const auto vulkan = refined(device(), pairs, options), cpu = refined(cpu_device(1), pairs, options);
    for (std::size_t i = 0; i < cpu.size(); ++i)
      EXPECT_NEAR(vulkan[i].score_before, cpu[i].score_before, 1e-6) << i;
  }
}

}  // namespace
}  // namespace bitr
