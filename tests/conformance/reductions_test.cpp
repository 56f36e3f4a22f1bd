// softmax_sum against cloud_softmax and cloud_sum, and both against plain loops; point_attention on a large
// cloud; the pose's projection.
#include <algorithm>
#include <cmath>

#include "core/random.hpp"
#include "model/build.hpp"
#include "support/cloud_batch.hpp"
#include "support/configurations.hpp"
#include "support/op_run.hpp"
#include "support/random_motion.hpp"

namespace bitr {
namespace {

using graph::BatchLayout;
using graph::Rows;
using test::OpTensor;

double largest_difference(const std::vector<double>& a, const std::vector<double>& b) {
  double worst = a.size() == b.size() ? 0 : INFINITY;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
    worst = std::abs(a[i] - b[i]) <= worst ? worst : std::abs(a[i] - b[i]);
  return worst;
}

class SoftmaxSums : public testing::TestWithParam<double> {};

TEST_P(SoftmaxSums, EqualSoftmaxThenSumAndThePlainLoop) {
  Random random(4);
  const BatchLayout layout(std::vector<std::uint32_t>{1, 1024, 1025, 7, 2, 3000}, 4);
  const std::size_t points = layout.rows(Rows::point);
  constexpr int channels = 5, width = 7, value_width = 4, skip = 1;
  OpTensor logits{Rows::point, 1, width, false, {}, {}}, values{Rows::point, 1, value_width, false, {}, {}};
  // Exact in float. Spread ±range: a few points take nearly all the weight at the largest.
  for (std::size_t i = 0; i < points * width; ++i)
    logits.values.push_back(std::round(random.uniform(-1, 1) * 1024) / 1024 * GetParam());
  for (std::size_t i = 0; i < points * value_width; ++i)
    values.values.push_back(std::round(random.uniform(-1, 1) * 1024) / 1024);
  ThreadPool pool(2);
  const OpTensor weights{Rows::point, 1, channels, false, {}, {}};
  // Shaped as a tensor of clouds that holds channels × width numbers each.
  const OpTensor all{Rows::cloud, channels, value_width, false, {}, {}},
      part{Rows::cloud, channels, value_width - skip, false, {}, {}};

  const auto plain = [&](int first) {
    std::vector<double> sums;
    for (std::uint32_t cloud = 0; cloud < layout.clouds(); ++cloud)
      for (int c = 0; c < channels; ++c) {
        double peak = -INFINITY, total = 0;
        std::vector<double> sum(value_width - first, 0.0);
        const std::size_t begin = layout.cloud_offset[cloud], end = layout.cloud_offset[cloud + 1];
        for (std::size_t row = begin; row < end; ++row) peak = std::max(peak, logits.values[row * width + c]);
        for (std::size_t row = begin; row < end; ++row) {
          const double e = std::exp(logits.values[row * width + c] - peak);
          total += e;
          for (int w = first; w < value_width; ++w)
            sum[w - first] += e * values.values[row * value_width + w];
        }
        for (double s : sum) sums.push_back(s / total);
      }
    return sums;
  };
  const auto check = [&]<class T>(T, double bound) {
    const auto softmax =
        test::run_op<T>(ops::CloudSoftmax{channels}, layout, {logits}, {weights}, pool).front();
    const auto sum =
        test::run_op<T>(ops::CloudSum{channels, skip}, layout, {softmax, values}, {part}, pool).front();
    const auto both = test::run_op<T>(ops::SoftmaxSum{channels, {0, skip}}, layout, {logits, values, values},
                                      {all, part}, pool);
    EXPECT_LE(largest_difference(sum.values, plain(skip)), bound);
    EXPECT_LE(largest_difference(both[0].values, plain(0)), bound);
    EXPECT_LE(largest_difference(both[1].values, plain(skip)), bound);
  };
  check(double{}, 1e-13);
  check(float{}, 0.1 * ops::SoftmaxSum{}.float_error());
}

INSTANTIATE_TEST_SUITE_P(Ranges, SoftmaxSums, testing::Values(0.0, 1.0, 30.0, 4096.0));

// 70,001 points, features of the size the extractor gives, neighbours anywhere in the cloud.
TEST(PointAttention, SeventyThousandPoints) {
  Random random(6);
  const auto graph = model::fold(model::build_graph(test::perturbed_weights({}, 2), Mode::scale_exact));
  const BatchLayout layout(std::vector<std::uint32_t>{70001, 30}, 32);
  const std::size_t points = layout.rows(Rows::point);
  const auto node = std::find_if(graph.nodes.begin(), graph.nodes.end(), [](const graph::Node& n) {
    const auto* op = std::get_if<ops::PointAttention>(&n.op);
    return op && !op->per_cloud && !op->uniform;
  });
  ASSERT_NE(node, graph.nodes.end());
  std::vector<OpTensor> inputs;
  for (const auto id : node->inputs) {
    OpTensor tensor = OpTensor::like(graph.tensors[id]);
    const std::size_t size = static_cast<std::size_t>(tensor.per_row) * tensor.width;
    if (tensor.index)
      for (std::size_t i = 0; i < points * size; ++i)
        tensor.indices.push_back(
            static_cast<std::uint32_t>(i / size < 70001 ? random.below(70001) : 70001 + random.below(30)));
    else
      for (std::size_t i = 0; i < points * size; ++i)
        tensor.values.push_back(std::round(random.uniform(-1, 1) * 0x1p20) * 0x1p-20);
    inputs.push_back(tensor);
  }
  const std::vector<OpTensor> outputs = {OpTensor::like(graph.tensors[node->outputs[0]])};
  ThreadPool pool(2);
  const auto single = test::run_op<float>(node->op, layout, inputs, outputs, pool).front().values;
  const auto exact = test::run_op<double>(node->op, layout, inputs, outputs, pool).front().values;
  const double largest = std::abs(*std::max_element(
      exact.begin(), exact.end(), [](double a, double b) { return std::abs(a) < std::abs(b); }));
  EXPECT_LE(largest_difference(single, exact), ops::float_error(node->op) * largest);
}

TEST(ProjectPose, IsTheNearestRotationAndTheTranslationOfTheHead) {
  Random random(12);
  constexpr std::uint32_t pairs = 50;
  const BatchLayout layout(std::vector<std::uint32_t>(2 * pairs, 3), 4);
  OpTensor pieces{Rows::pair, 1, ops::piece_count, false, {}, {}};
  std::vector<Eigen::Matrix3d> truths;
  for (std::uint32_t p = 0; p < pairs; ++p) {
    // R·S with S symmetric and positive has R as its nearest rotation; stored with rows on the source's side.
    const Eigen::Matrix3d R = test::random_rotation(random), V = test::random_rotation(random);
    const Eigen::Vector3d s(random.uniform(2, 3), random.uniform(1, 2), random.uniform(0.1, 1));
    const Eigen::Matrix3d stored = (R * V * s.asDiagonal() * V.transpose()).transpose();
    truths.push_back(R);
    for (int i = 0; i < 9; ++i) pieces.values.push_back(stored(i / 3, i % 3));
    for (int i = 9; i < ops::piece_count; ++i) pieces.values.push_back(random.uniform(-1, 1));
  }
  ThreadPool pool(1);
  const OpTensor out{Rows::pair, 1, ops::pose_width, false, {}, {}};
  const auto check = [&]<class T>(T, double bound) {
    const auto poses = test::run_op<T>(ops::ProjectPose{}, layout, {pieces}, {out}, pool).front().values;
    for (std::uint32_t p = 0; p < pairs; ++p) {
      const double* pose = poses.data() + p * ops::pose_width;
      const Eigen::Map<const Eigen::VectorXd> piece(pieces.values.data() + p * ops::piece_count,
                                                    ops::piece_count);
      for (int i = 0; i < 9; ++i) EXPECT_NEAR(pose[i], truths[p](i / 3, i % 3), bound);
      const Eigen::Vector3d t = piece.segment<3>(12) + piece.segment<3>(18) -
                                truths[p] * (piece.segment<3>(9) + piece.segment<3>(15));
      for (int i = 0; i < 3; ++i) EXPECT_NEAR(pose[9 + i], t[i], 4 * bound);
      EXPECT_GE(pose[12], pose[13]);
      EXPECT_GE(pose[13], pose[14]);
      EXPECT_NEAR(std::hypot(pose[12], pose[13], pose[14]), 1, 1e-6);
      EXPECT_NEAR(pose[15], 1, 1e-6);
    }
  };
  check(double{}, 1e-13);
  check(float{}, 3e-6);
}

}  // namespace
}  // namespace bitr
