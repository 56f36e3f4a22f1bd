// Gradients of the attention layers on Vulkan against the CPU in double, of random gradients of their
// outputs, on the tensors the layers meet in the network; nothing outside their outputs touched.
#include <algorithm>
#include <cmath>
#include <set>

#include "model/build.hpp"
#include "ops/constants.hpp"
#include "support/cases.hpp"
#include "support/cloud_batch.hpp"
#include "support/configurations.hpp"
#include "support/op_run.hpp"
#include "support/vulkan.hpp"

namespace bitr {
namespace {

using test::Case;
using test::OpTensor;

std::vector<Case> cases() {
  ModelConfig square;
  square.relu_square = square.return_normals = true;
  return {{"one_more", {}, {{26, 25}}},
          {"ragged", {}, {{25, 333}, {129, 31}, {64, 65}}},
          {"normals_duplicates", test::normals_and_colors(), {{70, 41}, {26, 100}}, 2},
          {"square", square, {{90, 130}}, 20},
          {"one_neighbour", test::shallow_model(), {{2, 3}, {9, 2}}},
          // Two runs of two-sided layers.
          {"many_pairs", {}, std::vector<std::array<std::size_t, 2>>(33, {25, 27})},
          {"wide", test::wide_model(6), {{65, 70}}, 5}};
}

class AttentionGradient : public testing::TestWithParam<Case> {
 protected:
  void SetUp() override {
    if (!test::vulkan()) GTEST_SKIP() << "no Vulkan";
    random_.emplace(99);
    batch_.emplace(*random_, GetParam().pairs);
    if (GetParam().duplicates) batch_->add_duplicates(GetParam().duplicates);
    const auto weights = test::perturbed_weights(GetParam().config, 3);
    executor_.emplace(model::fold(model::build_graph(weights, Mode::scale_exact)), pool_,
                      cpu::ExecutorOptions{.retain = true});
    batch_->run(*executor_, GetParam().config.num_key_points);
    layout_ = batch_->layout(GetParam().config.num_key_points);
  }

  template <class Operation>
  void check() {
    for (const graph::Node& node : executor_->graph().nodes)
      if (const auto* op = std::get_if<Operation>(&node.op)) {
        SCOPED_TRACE(node.name);
        check(*op, node);
      }
  }

  // With respect to everything that may depend on weights.
  template <class Operation>
  void check(const Operation& op, const graph::Node& node) {
    ops::Gradient<Operation> gradient{.op = op,
                                      .inputs = static_cast<int>(node.inputs.size()),
                                      .outputs = 1,
                                      .grad_outputs = {0},
                                      .needs_input_grad = {},
                                      .constants = ops::constant_count(op) > 0};
    std::vector<OpTensor> inputs, outputs;
    for (std::size_t i = 0; i < node.inputs.size(); ++i) {
      inputs.push_back(value(node.inputs[i]));
      if (inputs.back().index || !wanted(node.inputs[i])) continue;
      gradient.needs_input_grad.push_back(static_cast<int>(i));
      outputs.push_back(OpTensor::like(executor_->graph().tensors[node.inputs[i]]));
    }
    inputs.push_back(value(node.outputs[0]));
    inputs.push_back(inputs.back());
    for (double& x : inputs.back().values) x = static_cast<float>(random_->normal());
    if (gradient.constants)
      outputs.push_back({graph::Rows::one, 1, static_cast<int>(ops::constant_count(op)), false, {}, {}});
    const auto exact = test::run_op<double>(gradient, layout_, inputs, outputs, pool_);
    const auto device = test::run_op_vulkan(gradient, layout_, inputs, outputs);
    for (std::size_t i = 0; i < device.size(); ++i) {
      SCOPED_TRACE(i < gradient.needs_input_grad.size()
                       ? "input " + std::to_string(gradient.needs_input_grad[i])
                       : "constants");
      compare(device[i].values, exact[i].values);
    }
  }

  bool wanted(graph::TensorId id) const { return !executor_->graph().inputs.holds(id); }

  OpTensor value(graph::TensorId id) const { return test::rounded(test::read(*executor_, id)); }

  void compare(const std::vector<double>& device, const std::vector<double>& exact) {
    ASSERT_EQ(device.size(), exact.size());
    std::vector<double> errors;
    double largest = 0;
    for (std::size_t i = 0; i < exact.size(); ++i) {
      ASSERT_TRUE(std::isfinite(device[i]) && std::isfinite(exact[i])) << "element " << i;
      errors.push_back(std::abs(device[i] - exact[i]));
      largest = std::max(largest, std::abs(exact[i]));
    }
    const std::size_t where = std::max_element(errors.begin(), errors.end()) - errors.begin();
    EXPECT_LE(errors[where], ops::kink_error * largest)
        << "element " << where << " of " << exact.size() << ": " << device[where] << ", not " << exact[where];
    const auto usual = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() * 19 / 20);
    std::nth_element(errors.begin(), usual, errors.end());
    EXPECT_LE(*usual, ops::smooth_error * largest);
    if (largest > 0) worst_ = std::max(worst_, *usual / largest);
  }
  void TearDown() override { RecordProperty("worst", std::to_string(worst_ * 1e9) + "e-9"); }

  std::optional<Random> random_;
  std::optional<test::CloudBatch> batch_;
  ThreadPool pool_{2};
  std::optional<cpu::Executor<double>> executor_;
  graph::BatchLayout layout_;
  double worst_ = 0;
};

TEST_P(AttentionGradient, PointAttention) { check<ops::PointAttention>(); }
TEST_P(AttentionGradient, MeanDirection) { check<ops::MeanDirection>(); }
TEST_P(AttentionGradient, PairAttention) { check<ops::PairAttention>(); }

INSTANTIATE_TEST_SUITE_P(Cases, AttentionGradient, testing::ValuesIn(cases()),
                         [](const auto& c) { return c.param.name; });

}  // namespace
}  // namespace bitr
