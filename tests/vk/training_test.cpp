// What training adds on Vulkan: the loss and the gradients around the attention layers against the CPU in
// double, on the tensors they meet in a training graph, and the executor when constants change.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "api/internal.hpp"
#include "support/cases.hpp"
#include "support/cloud_batch.hpp"
#include "support/configurations.hpp"
#include "support/op_run.hpp"
#include "support/random_motion.hpp"
#include "support/symmetry.hpp"
#include "support/vulkan.hpp"
#include "train/differentiator.hpp"
#include "train/training_graph.hpp"
#include "vk/network.hpp"

namespace bitr {
namespace {

using test::OpTensor;

struct Case {
  const char* name;
  ModelConfig config;
  std::vector<std::array<std::size_t, 2>> pairs;
  ops::LossKind loss;
  friend std::ostream& operator<<(std::ostream& out, const Case& c) { return out << c.name; }
};

std::vector<Case> cases() {
  ModelConfig wide;
  wide.num_channels = wide.feature_num_channels = 6;
  wide.div = 3;
  wide.num_key_points = 36;
  wide.re_convert_k = 33;
  using enum ops::LossKind;
  return {{"direct", {}, {{25, 333}, {300, 31}, {64, 65}}, direct},
          {"robust", {}, {{25, 333}, {300, 31}, {64, 65}}, robust},
          {"official", {}, {{25, 333}, {300, 31}, {64, 65}}, official},
          {"trained", test::trained_model(), {{140, 97}, {97, 1100}}, direct},
          {"wide", wide, {{65, 70}}, direct},
          {"few", test::shallow_model(), {{9, 2}, {4, 5}, {3, 8}, {6, 6}}, direct}};
}

bool tested(const ops::Op& op) {
  return std::visit(
      [](const auto& concrete) {
        using Op = std::decay_t<decltype(concrete)>;
        return std::is_same_v<Op, ops::Sum> || std::is_same_v<Op, ops::Loss> ||
               std::is_same_v<Op, ops::Gradient<ops::Loss>> ||
               std::is_same_v<Op, ops::Gradient<ops::ProjectPose>> ||
               std::is_same_v<Op, ops::Gradient<ops::Head>> ||
               std::is_same_v<Op, ops::Gradient<ops::MergePairs>> ||
               std::is_same_v<Op, ops::Gradient<ops::SoftmaxSum>> ||
               std::is_same_v<Op, ops::Gradient<ops::CloudCoefficients>>;
      },
      op);
}

// Which inputs of a node are gradients of its outputs.
std::set<graph::TensorId> output_gradients(const graph::Node& node) {
  return std::visit(
      [&](const auto& op) {
        std::set<graph::TensorId> ids;
        if constexpr (requires { op.grad_outputs; })
          for (const int output : op.grad_outputs) ids.insert(node.inputs[op.grad_output_at(output)]);
        return ids;
      },
      node.op);
}

class Training : public testing::TestWithParam<Case> {
 protected:
  void SetUp() override {
    if (!test::vulkan()) GTEST_SKIP() << "no Vulkan device";
    const Case& c = GetParam();
    const auto training = train::training_graph(test::perturbed_weights(c.config, 3), c.loss, false);
    executor_.emplace(training.result.graph, pool_, cpu::ExecutorOptions{.retain = true});
    const test::CloudBatch batch(random_, c.pairs);
    layout_ = batch.layout(c.config.num_key_points);
    executor_->prepare(layout_);
    double* truth = executor_->data(executor_->graph().input(graph::Input::truth));
    for (std::uint32_t pair = 0; pair < layout_.pairs(); ++pair, truth += ops::truth_width) {
      const Pose pose = test::random_pose(random_);
      std::copy(pose.rotation.begin(), pose.rotation.end(), truth);
      std::copy(pose.translation.begin(), pose.translation.end(), truth + 9);
      // No symmetry, any angle about an axis, quarter turns.
      std::copy(ops::no_symmetry.begin(), ops::no_symmetry.end(), truth + ops::pose_numbers);
      if (pair % 3 == 0) continue;
      const Eigen::Vector3d axis = test::random_unit(random_);
      for (int a = 0; a < 3; ++a) {
        truth[ops::pose_numbers + a] = axis[a];
        truth[ops::pose_numbers + 3 + a] = 0.3 * random_.normal();
      }
      truth[ops::pose_numbers + 6] = pair % 3 == 1 ? 0 : std::numbers::pi / 2;
      test::any_symmetry(random_, pair, truth + ops::pose_numbers);
    }
    batch.fill(*executor_);
    executor_->run();
  }

  const graph::TensorInfo& info(graph::TensorId id) const { return executor_->graph().tensors[id]; }

  // Rounded to float first, so that both read the same numbers; or random.
  OpTensor input(graph::TensorId id, bool random) {
    OpTensor tensor = test::read(*executor_, id);
    if (random)
      for (double& x : tensor.values) x = random_.normal();
    return test::rounded(std::move(tensor));
  }

  void check(const graph::Node& node, bool random) {
    std::vector<OpTensor> inputs, outputs;
    const auto gradients = output_gradients(node);
    for (const auto id : node.inputs) inputs.push_back(input(id, random && gradients.count(id)));
    for (const auto id : node.outputs) outputs.push_back(OpTensor::like(info(id)));
    const auto exact = test::run_op<double>(node.op, layout_, inputs, outputs, pool_);
    const auto device = test::run_op_vulkan(node.op, layout_, inputs, outputs);
    ASSERT_EQ(device.size(), exact.size());
    for (std::size_t i = 0; i < exact.size(); ++i) {
      double worst = 0, largest = 0;
      for (std::size_t j = 0; j < exact[i].values.size(); ++j) {
        ASSERT_TRUE(std::isfinite(device[i].values[j]) && std::isfinite(exact[i].values[j])) << j;
        worst = std::max(worst, std::abs(device[i].values[j] - exact[i].values[j]));
        largest = std::max(largest, std::abs(exact[i].values[j]));
      }
      EXPECT_LE(worst, ops::float_error(node.op) * largest) << info(node.outputs[i]).name;
      if (largest > 0) RecordProperty(info(node.outputs[i]).name, std::to_string(worst / largest * 1e9));
    }
  }

  Random random_{7};
  ThreadPool pool_{2};
  std::optional<cpu::Executor<double>> executor_;
  graph::BatchLayout layout_;
};

TEST_P(Training, Operations) {
  std::set<std::size_t> met;
  for (const graph::Node& node : executor_->graph().nodes) {
    if (!tested(node.op)) continue;
    SCOPED_TRACE(node.name);
    met.insert(node.op.index());
    for (const bool random : {false, true}) check(node, random);
  }
  EXPECT_GE(met.size(), GetParam().loss == ops::LossKind::official ? 7u : 6u);
}

INSTANTIATE_TEST_SUITE_P(Cases, Training, testing::ValuesIn(cases()),
                         [](const auto& c) { return c.param.name; });

// Another seed's sector tables have other sizes.
graph::Graph network(std::uint64_t seed) {
  return model::fold(model::build_graph(test::perturbed_weights({}, seed), Mode::scale_exact));
}

TEST(TrainingExecutor, GoesOnWithOtherConstants) {
  BITR_NEEDS_VULKAN();
  const test::VulkanNetwork batch({{200, 90}, {25, 333}});
  vk::Executor executor(test::vulkan(), network(1), batch.capacity());
  std::vector<std::vector<float>> poses;
  for (const std::uint64_t seed : {1, 2, 3, 4}) {
    vk::Executor fresh(test::vulkan(), network(seed), batch.capacity());
    poses.push_back(batch.run(fresh));
    if (seed > 1) executor.replace(network(seed));
    EXPECT_EQ(batch.run(executor), poses.back()) << seed;
  }
  EXPECT_NE(poses[0], poses[1]);
  // What has held them all holds each of them.
  const std::size_t allocations = test::vulkan()->allocations();
  for (const std::uint64_t seed : {2, 1, 4}) {
    executor.replace(network(seed));
    EXPECT_EQ(batch.run(executor), poses[seed - 1]) << seed;
  }
  EXPECT_EQ(test::vulkan()->allocations(), allocations);
}

TEST(TrainingExecutor, RefusesOtherOperations) {
  BITR_NEEDS_VULKAN();
  ModelConfig config;
  config.num_layers = 1;
  const test::VulkanNetwork batch({{200, 90}}), other({{200, 90}}, config);
  vk::Executor executor(test::vulkan(), batch.graph, batch.capacity());
  EXPECT_THROW(executor.replace(other.graph), Failure);
}

// Pairs of clouds with poses, and what trains on them.
struct Pairs {
  std::vector<PointCloud> clouds;
  std::vector<train::TrainingPair> pairs;

  Pairs(Random& random, const std::vector<std::array<std::size_t, 2>>& sizes)
      : clouds(test::CloudBatch(random, sizes).clouds) {
    for (std::size_t i = 0; i < sizes.size(); ++i)
      pairs.push_back({clouds[i], clouds[sizes.size() + i], test::random_pose(random)});
  }
};

// The largest difference over the gradient's largest entry.
double difference(const train::Gradients& one, const train::Gradients& exact) {
  double worst = 0, largest = 0;
  for (const auto& [name, matrix] : exact) {
    worst = std::max(worst, (one.at(name) - matrix).cwiseAbs().maxCoeff());
    largest = std::max(largest, matrix.cwiseAbs().maxCoeff());
  }
  return worst / largest;
}

// From step to step the weights, and how many points there are, change.
void compare_steps(const ModelConfig& config, ops::LossKind loss) {
  const auto pool = std::make_shared<ThreadPool>(2);
  const Device cpu = Internal::device(pool), vulkan = Internal::device(pool, test::vulkan());
  Random random(5);
  const auto exact = train::make_differentiator(cpu, {}, {.loss = loss, .precision = Precision::f64});
  const auto single = train::make_differentiator(cpu, {}, {.loss = loss});
  const auto device = train::make_differentiator(vulkan, {}, {.loss = loss});
  train::Gradients expected, rounded, found, again;
  for (const std::uint64_t seed : {1, 2, 3}) {
    const auto weights = test::perturbed_weights(config, seed);
    const Pairs pairs(random, {{150, 200 - 20 * seed}, {97, 130}});
    const double total = exact->evaluate(weights, pairs.pairs, expected).total();
    const double float_total = single->evaluate(weights, pairs.pairs, rounded).total();
    const double device_total = device->evaluate(weights, pairs.pairs, found).total();
    // Where a neighbour list hangs on the last bit, float costs more, wherever it is computed.
    EXPECT_NEAR(device_total, total, std::max(1e-4 * std::abs(total), 3 * std::abs(float_total - total)));
    const double worst = difference(found, expected), float_worst = difference(rounded, expected);
    EXPECT_LE(worst, std::max(1e-3, 3 * float_worst)) << seed;
    testing::Test::RecordProperty("worst" + std::to_string(seed),
                                  std::to_string(worst) + ", CPU " + std::to_string(float_worst));
    device->evaluate(weights, pairs.pairs, again);
    EXPECT_EQ(again, found) << seed;
  }
}

TEST(TrainingStep, GradientsAreTheCpus) {
  BITR_NEEDS_VULKAN();
  compare_steps({}, ops::LossKind::direct);
}

TEST(TrainingStep, GradientsOfTheOfficialLossAreTheCpus) {
  BITR_NEEDS_VULKAN();
  compare_steps({}, ops::LossKind::official);
}

TEST(TrainingStep, GradientsOfATrainedModelAreTheCpus) {
  BITR_NEEDS_VULKAN();
  ModelConfig trained;
  trained.neighbor_dilation = 4;
  trained.relu_square = trained.centroid_offset = trained.return_normals = true;
  compare_steps(trained, ops::LossKind::direct);
}

}  // namespace
}  // namespace bitr
