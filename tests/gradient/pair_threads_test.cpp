// The gradient of two-sided layers over many pairs: the same bits for any number of threads, every pair's
// share in it, and memory that does not grow with the machine.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "cpu/sums_at_once.hpp"
#include "model/build.hpp"
#include "ops/constants.hpp"
#include "support/cloud_batch.hpp"
#include "support/configurations.hpp"
#include "support/op_run.hpp"

namespace bitr {
namespace {

using test::OpTensor;

// A two-sided layer of the network and what it meets there.
class ManyPairs : public testing::Test {
 protected:
  static constexpr std::size_t pairs = 11;

  void SetUp() override {
    const model::Weights weights = test::perturbed_weights(config_, 3);
    Random random(12);
    const test::CloudBatch batch(random, std::vector<std::array<std::size_t, 2>>(pairs, {27, 25}));
    ThreadPool pool(2);
    cpu::Executor<double> network(model::fold(model::build_graph(weights, Mode::scale_exact)), pool,
                                  {.retain = true});
    batch.run(network, config_.num_key_points);
    layout_ = network.layout();
    for (const graph::Node& node : network.graph().nodes)
      if (const auto* op = std::get_if<ops::PairAttention>(&node.op)) {
        gradient_.emplace(ops::Gradient<ops::PairAttention>{.op = *op,
                                                            .inputs = static_cast<int>(node.inputs.size()),
                                                            .outputs = 1,
                                                            .grad_outputs = {0},
                                                            .needs_input_grad = {0, 2},
                                                            .constants = true});
        inputs_.clear();
        for (const graph::TensorId id : node.inputs)
          inputs_.push_back(test::rounded(test::read(network, id)));
        inputs_.push_back(test::rounded(test::read(network, node.outputs[0])));
      }
    ASSERT_TRUE(gradient_);
    inputs_.push_back(inputs_.back());
    for (double& x : inputs_.back().values) x = static_cast<float>(random.normal());
  }

  template <class T>
  std::vector<OpTensor> run(const graph::BatchLayout& layout, const std::vector<OpTensor>& inputs,
                            unsigned threads) {
    const auto like = [](OpTensor tensor) {
      tensor.values.clear();
      return tensor;
    };
    ThreadPool pool(threads);
    return test::run_op<T>(
        *gradient_, layout, inputs,
        {like(inputs[0]),
         like(inputs[2]),
         {graph::Rows::one, 1, static_cast<int>(ops::constant_count(gradient_->op)), false, {}, {}}},
        pool);
  }

  // One pair's rows, as if there were no others.
  OpTensor of_pair(const OpTensor& tensor, std::size_t pair) const {
    OpTensor part = tensor;
    const std::size_t rows = static_cast<std::size_t>(config_.num_key_points),
                      size = rows * tensor.per_row * tensor.width;
    const auto cut = [&](auto& from) {
      if (!from.empty()) from = {from.begin() + pair * size, from.begin() + (pair + 1) * size};
    };
    cut(part.values);
    cut(part.indices);
    for (std::uint32_t& index : part.indices) index -= static_cast<std::uint32_t>(pair * rows);
    return part;
  }

  static void expect_near(const std::vector<double>& found, const std::vector<double>& expected) {
    ASSERT_EQ(found.size(), expected.size());
    double worst = 0, largest = 0;
    for (std::size_t i = 0; i < found.size(); ++i) {
      ASSERT_TRUE(std::isfinite(found[i])) << i;
      worst = std::max(worst, std::abs(found[i] - expected[i]));
      largest = std::max(largest, std::abs(expected[i]));
    }
    EXPECT_GT(largest, 0);
    EXPECT_LE(worst, 1e-12 * largest);
  }

  const ModelConfig config_ = {};
  graph::BatchLayout layout_;
  std::optional<ops::Gradient<ops::PairAttention>> gradient_;
  std::vector<OpTensor> inputs_;
};

TEST_F(ManyPairs, ThreadsChangeNoBit) {
  const auto single = run<float>(layout_, inputs_, 1), exact = run<double>(layout_, inputs_, 1);
  for (const unsigned threads : {2, 3, 8}) {
    const auto again = run<float>(layout_, inputs_, threads),
               exact_again = run<double>(layout_, inputs_, threads);
    for (std::size_t i = 0; i < single.size(); ++i) {
      EXPECT_EQ(again[i].values, single[i].values) << threads << " threads, output " << i;
      EXPECT_EQ(exact_again[i].values, exact[i].values) << threads << " threads, output " << i;
    }
  }
}

TEST_F(ManyPairs, EveryPairHasItsShare) {
  const auto together = run<double>(layout_, inputs_, 3);
  std::vector<double> sum(together[2].values.size());
  for (std::size_t pair = 0; pair < pairs; ++pair) {
    std::vector<OpTensor> inputs;
    for (const OpTensor& tensor : inputs_) inputs.push_back(of_pair(tensor, pair));
    const std::uint32_t sizes[] = {27, 25};
    const auto alone = run<double>({sizes, layout_.key_points}, inputs, 1);
    expect_near(of_pair(together[0], pair).values, alone[0].values);
    expect_near(of_pair(together[1], pair).values, alone[1].values);
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += alone[2].values[i];
  }
  expect_near(together[2].values, sum);
}

TEST(SumsAtOnce, AreAFewPerThreadWithinTheMemoryForThem) {
  constexpr std::size_t megabyte = std::size_t{1} << 20;
  EXPECT_EQ(cpu::sums_at_once(16, 2, megabyte), 8u);
  EXPECT_EQ(cpu::sums_at_once(100, 12, megabyte), 48u);
  EXPECT_EQ(cpu::sums_at_once(3, 12, megabyte), 3u);
  EXPECT_EQ(cpu::sums_at_once(1000, 1000, 4 * megabyte), cpu::most_sum_bytes / (4 * megabyte));
  EXPECT_EQ(cpu::sums_at_once(16, 8, cpu::most_sum_bytes + 1), 1u);
  EXPECT_EQ(cpu::sums_at_once(100, 8, 0), 32u);
  EXPECT_EQ(cpu::sums_at_once(0, 8, megabyte), 0u);
}

}  // namespace
}  // namespace bitr
