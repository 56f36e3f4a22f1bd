// softmax_sum on Vulkan: every shape of its work, against the CPU in double; the same bits whatever else is
// in the batch; clouds of millions of points.
#include <algorithm>
#include <cmath>

#include "core/random.hpp"
#include "support/op_run.hpp"
#include "support/vulkan.hpp"

namespace bitr {
namespace {

using graph::BatchLayout;
using graph::Rows;
using test::OpTensor;

struct SumShape {
  int channels, logit_width;
  std::vector<std::array<int, 2>> values;  ///< width, skip
};

OpTensor random_tensor(Random& random, const BatchLayout& layout, int width, double range) {
  OpTensor tensor{Rows::point, 1, width, false, {}, {}};
  for (std::size_t i = 0; i < layout.rows(Rows::point) * width; ++i)
    tensor.values.push_back(static_cast<float>(random.uniform(-1, 1) * range));
  return tensor;
}

struct SumRun {
  ops::SoftmaxSum op;
  std::vector<OpTensor> inputs, outputs;
};

SumRun make_run(const SumShape& shape, const BatchLayout& layout, double range) {
  Random random(17);
  SumRun run{{shape.channels, {}}, {random_tensor(random, layout, shape.logit_width, range)}, {}};
  for (const auto& [width, skip] : shape.values) {
    run.op.skip.push_back(skip);
    run.inputs.push_back(random_tensor(random, layout, width, 3));
    run.outputs.push_back({Rows::cloud, shape.channels, width - skip, false, {}, {}});
  }
  return run;
}

// Largest error over the largest entry of a tensor of sums: these inputs need a tenth of the bound.
void check(const SumRun& run, const BatchLayout& layout) {
  ThreadPool pool(2);
  const auto exact = test::run_op<double>(run.op, layout, run.inputs, run.outputs, pool);
  const auto device = test::run_op_vulkan(run.op, layout, run.inputs, run.outputs);
  ASSERT_EQ(device.size(), exact.size());
  for (std::size_t v = 0; v < exact.size(); ++v) {
    double worst = 0, largest = 0;
    for (std::size_t i = 0; i < exact[v].values.size(); ++i) {
      ASSERT_TRUE(std::isfinite(device[v].values[i])) << "tensor " << v << ", number " << i;
      worst = std::max(worst, std::abs(device[v].values[i] - exact[v].values[i]));
      largest = std::max(largest, std::abs(exact[v].values[i]));
    }
    EXPECT_LE(worst, 0.1 * run.op.float_error() * largest) << "tensor " << v;
  }
}

const SumShape shapes[] = {{1, 1, {{3, 0}}},
                           {1, 5, {{16, 0}, {5, 1}}},
                           {1, 9, {{48, 0}, {9, 1}, {7, 2}, {5, 3}, {5, 4}}},
                           {2, 3, {{1, 0}}},
                           {5, 7, {{4, 1}, {4, 3}, {11, 6}}},
                           {32, 32, {{3, 0}}},
                           {33, 40, {{3, 0}, {6, 1}}},
                           {200, 200, {{3, 0}}}};

class SoftmaxSum : public testing::Test {
 protected:
  void SetUp() override {
    if (!test::vulkan()) GTEST_SKIP() << "no Vulkan device";
  }
};

TEST_F(SoftmaxSum, EveryShape) {
  const BatchLayout layout(std::vector<std::uint32_t>{1, 127, 128, 129, 700, 2, 31, 33, 4097, 256}, 4);
  for (const SumShape& shape : shapes)
    for (const double range : {0.0, 1.0, 30.0, 4096.0}) {
      SCOPED_TRACE(testing::Message() << shape.channels << " channels, logits up to " << range);
      check(make_run(shape, layout, range), layout);
    }
}

TEST_F(SoftmaxSum, BitsDoNotDependOnTheBatch) {
  const std::vector<std::uint32_t> sizes = {1, 127, 300, 129, 700, 2, 31, 1025, 64, 256};
  const BatchLayout layout(sizes, 4);
  for (const SumShape& shape : shapes) {
    const SumRun run = make_run(shape, layout, 10);
    const auto together = test::run_op_vulkan(run.op, layout, run.inputs, run.outputs);
    ASSERT_EQ(together.size(), run.outputs.size());
    for (std::uint32_t cloud = 0; cloud < layout.clouds(); ++cloud) {
      // The same cloud twice: a pair.
      const BatchLayout alone(std::vector<std::uint32_t>(2, sizes[cloud]), 4);
      std::vector<OpTensor> inputs = run.inputs;
      for (OpTensor& input : inputs) {
        const auto begin = input.values.begin() + layout.cloud_offset[cloud] * input.width,
                   end = input.values.begin() + layout.cloud_offset[cloud + 1] * input.width;
        std::vector<double> rows(begin, end);
        rows.insert(rows.end(), begin, end);
        input.values = rows;
      }
      const auto results = test::run_op_vulkan(run.op, alone, inputs, run.outputs);
      ASSERT_EQ(results.size(), run.outputs.size());
      for (std::size_t v = 0; v < results.size(); ++v) {
        const std::size_t count = results[v].values.size() / 2;
        const auto expected = together[v].values.begin() + cloud * count;
        EXPECT_TRUE(std::equal(expected, expected + count, results[v].values.begin()) &&
                    std::equal(expected, expected + count, results[v].values.begin() + count))
            << "cloud " << cloud << ", " << shape.channels << " channels, tensor " << v;
      }
    }
  }
}

// Beyond 65535 work groups, and far into the loops over chunks.
TEST_F(SoftmaxSum, MillionsOfPoints) {
  const BatchLayout layout(std::vector<std::uint32_t>{2300001, 30}, 4);
  check(make_run({1, 1, {{3, 0}}}, layout, 5), layout);
  check(make_run({4, 4, {{3, 0}}}, layout, 0), layout);
}

}  // namespace
}  // namespace bitr
