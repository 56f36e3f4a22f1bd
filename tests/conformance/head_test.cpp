// head on Vulkan against the CPU in double, where its norm meets channels without variance, far from zero,
// tiny or huge, and at its largest sizes.
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

struct HeadShape {
  int scalars, others;
  std::uint32_t keys;
};

ops::Head make_head(Random& random, const HeadShape& shape, double eps) {
  ops::Head op;
  op.fiber = {
      {{0, 0}, shape.scalars}, {{0, 1}, shape.others}, {{1, 0}, shape.others}, {{1, 1}, shape.others}};
  op.eps = eps;
  const auto numbers = [&](int rows, int cols) {
    return Eigen::MatrixXd(Eigen::MatrixXd::NullaryExpr(rows, cols, [&] { return random.uniform(-1, 1); }));
  };
  op.norm_weight = numbers(shape.scalars, 1);
  op.norm_bias = numbers(shape.scalars, 1);
  op.mean_scale = Eigen::VectorXd::Ones(shape.scalars);
  op.logit_weight = numbers(3, shape.scalars);
  op.logit_bias = numbers(3, 1);
  op.vector_mix = numbers(1, shape.others);
  op.matrix_mix = numbers(1, shape.others);
  return op;
}

class Head : public testing::Test {
 protected:
  void SetUp() override {
    if (!test::vulkan()) GTEST_SKIP() << "no Vulkan device";
  }

  // Features: uniform in ±1, changed by `change(value, row, column)`. `growth`: by which inputs exceed usual ones.
  template <class Change>
  void check(const ops::Head& op, const HeadShape& shape, const Change& change, double growth = 1) {
    const BatchLayout layout(std::vector<std::uint32_t>(6, 2), shape.keys);
    const std::size_t rows = layout.rows(Rows::pair_key);
    OpTensor positions{Rows::pair_key, 1, 6, false, {}, {}},
        features{Rows::pair_key, 1, op.fiber.size(), false, {}, {}};
    for (std::size_t i = 0; i < rows * 6; ++i)
      positions.values.push_back(static_cast<float>(random_.uniform(-1, 1)));
    for (std::size_t row = 0; row < rows; ++row)
      for (int c = 0; c < features.width; ++c)
        features.values.push_back(static_cast<float>(change(random_.uniform(-1, 1), row, c)));
    const auto out = [](Rows kind, int width) { return OpTensor{kind, 1, width, false, {}, {}}; };
    const std::vector<OpTensor> outputs = {out(Rows::pair_key, shape.scalars), out(Rows::pair_key, 3),
                                           out(Rows::pair_key, 3), out(Rows::pair, ops::piece_count)};
    ThreadPool pool(1);
    const auto exact = test::run_op<double>(op, layout, {positions, features}, outputs, pool);
    const auto device = test::run_op_vulkan(op, layout, {positions, features}, outputs);
    ASSERT_EQ(device.size(), outputs.size());
    for (std::size_t t = 0; t < outputs.size(); ++t) {
      double worst = 0, largest = 0;
      for (std::size_t i = 0; i < exact[t].values.size(); ++i) {
        ASSERT_TRUE(std::isfinite(device[t].values[i])) << "tensor " << t << ", number " << i;
        worst = std::max(worst, std::abs(device[t].values[i] - exact[t].values[i]));
        largest = std::max(largest, std::abs(exact[t].values[i]));
      }
      EXPECT_LE(worst, growth * op.float_error() * largest) << "tensor " << t;
    }
  }

  Random random_{21};
};

constexpr HeadShape usual{8, 2, 32};

TEST_F(Head, AnySizes) {
  for (const HeadShape& shape :
       {HeadShape{1, 1, 2}, usual, HeadShape{100, 25, 64}, HeadShape{256, 64, 1024}}) {
    SCOPED_TRACE(testing::Message() << shape.scalars << " channels, " << shape.keys << " key points");
    check(make_head(random_, shape, 1e-6), shape, [](double x, std::size_t, int) { return x; });
  }
}

TEST_F(Head, ChannelsWithoutVariance) {
  for (const double eps : {0.0, 1e-6})
    for (const double mean_scale : {1.0, 0.7}) {
      ops::Head op = make_head(random_, usual, eps);
      op.mean_scale.setConstant(mean_scale);
      // Half of them constant, one zero.
      check(op, usual, [](double x, std::size_t, int c) { return c >= 8 || c % 2 ? x : 0.1 * c; });
    }
}

TEST_F(Head, ChannelsFarFromZero) {
  check(make_head(random_, usual, 0), usual,
        [](double x, std::size_t, int c) { return c < 8 ? 1000 * c + x : x; });
}

TEST_F(Head, ChannelsOfAnySize) {
  for (const double size : {1e-30, 1e-20, 1e-3, 1e3, 1e15, 1e30})
    for (const double eps : {0.0, 1e-6}) {
      SCOPED_TRACE(testing::Message() << "size " << size << ", eps " << eps);
      check(make_head(random_, usual, eps), usual,
            [size](double x, std::size_t, int c) { return c < 8 ? x * size : x; });
    }
}

// Logits so far apart that one key point takes all the weight.
TEST_F(Head, OneKeyPointDecides) {
  ops::Head op = make_head(random_, usual, 1e-6);
  op.logit_weight *= 300;
  check(
      op, usual, [](double x, std::size_t, int) { return x; }, 50);
}

}  // namespace
}  // namespace bitr
