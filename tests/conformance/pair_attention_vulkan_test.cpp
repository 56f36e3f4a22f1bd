// Two-sided attention on Vulkan against the CPU in double precision, where whole batches of clouds seldom
// lead: edges so short that a norm's eps matters, directions shorter than their floor, odd sizes, several
// runs.
#include <algorithm>
#include <cmath>
#include <functional>

#include "core/random.hpp"
#include "model/build.hpp"
#include "support/configurations.hpp"
#include "support/op_run.hpp"
#include "support/vulkan.hpp"

namespace bitr {
namespace {

using graph::Rows;
using test::OpTensor;

ModelConfig small_config() {
  ModelConfig config;
  config.num_key_points = 12;
  config.re_convert_k = 7;
  return config;
}

std::vector<ops::PairAttention> layers(const ModelConfig& config, Mode mode) {
  std::vector<ops::PairAttention> found;
  for (const auto& node : model::fold(model::build_graph(test::perturbed_weights(config, 3), mode)).nodes)
    if (const auto* op = std::get_if<ops::PairAttention>(&node.op)) found.push_back(*op);
  EXPECT_EQ(found.size(), config.num_layers + 1u);
  return found;
}

// Positions and features of some pairs' nodes; every node sees the k that follow it.
struct Nodes {
  graph::BatchLayout layout;
  int k;
  std::vector<double> positions;  // both sides', 6 a node
  Random random{7};

  Nodes(const ModelConfig& config, std::uint32_t pairs = 1)
      : layout(std::vector<std::uint32_t>(2 * pairs, 2), static_cast<std::uint32_t>(config.num_key_points)),
        k(config.re_convert_k) {
    for (std::size_t i = 0; i < 6 * count(); ++i) positions.push_back(random.uniform(-1, 1));
  }
  std::size_t count() const { return layout.rows(Rows::pair_key); }
  void scale(double factor) {
    for (double& x : positions) x *= factor;
  }
  // Side 0 or 1 of every `step`-th node.
  void change(std::size_t step, int side, const std::function<double(double)>& to) {
    for (std::size_t node = 0; node < count(); node += step)
      for (std::size_t i = 0; i < 3; ++i)
        positions[6 * node + 3 * side + i] = to(positions[6 * node + 3 * side + i]);
  }

  std::vector<OpTensor> inputs(const ops::PairAttention& op) {
    OpTensor features{Rows::pair_key, 1, op.fiber_in.size(), false, {}, {}},
        index{Rows::pair_key, k, 1, true, {}, {}}, node{Rows::pair_key, 1, 6, false, positions, {}};
    for (std::size_t i = 0; i < count() * features.width; ++i) features.values.push_back(random.normal());
    for (OpTensor* tensor : {&features, &node})
      for (double& x : tensor->values) x = static_cast<double>(static_cast<float>(x));
    const std::uint32_t keys = layout.key_points;
    for (std::uint32_t i = 0; i < count(); ++i)
      for (std::uint32_t j = 1; j <= static_cast<std::uint32_t>(k); ++j)
        index.indices.push_back(i / keys * keys + (i + j) % keys);
    return {features, index, node};
  }
};

class PairAttentionVulkan : public testing::Test {
 protected:
  void SetUp() override {
    if (!test::vulkan()) GTEST_SKIP() << "no Vulkan device";
  }

  void check(const ModelConfig& config, const std::function<void(Nodes&)>& arrange = {},
             std::uint32_t pairs = 1, const std::vector<Mode>& modes = {Mode::reference, Mode::scale_exact}) {
    for (const Mode mode : modes)
      for (const auto& op : layers(config, mode)) {
        SCOPED_TRACE((mode == Mode::reference ? "reference, " : "scale-exact, ") +
                     std::to_string(op.tables.size()) + " tables");
        Nodes nodes(config, pairs);
        if (arrange) arrange(nodes);
        compare(op, nodes);
      }
  }

  void compare(const ops::PairAttention& op, Nodes& nodes) {
    const auto inputs = nodes.inputs(op);
    const std::vector<OpTensor> out = {{Rows::pair_key, 1, op.fiber_out.size(), false, {}, {}}};
    const auto exact = test::run_op<double>(op, nodes.layout, inputs, out, pool_).front().values;
    const auto device = test::run_op_vulkan(op, nodes.layout, inputs, out);
    ASSERT_EQ(device.size(), 1u);
    const auto& values = device.front().values;
    ASSERT_EQ(values.size(), exact.size());
    double worst = 0, largest = 0;
    for (std::size_t i = 0; i < exact.size(); ++i) {
      ASSERT_TRUE(std::isfinite(values[i])) << "element " << i;
      worst = std::max(worst, std::abs(values[i] - exact[i]));
      largest = std::max(largest, std::abs(exact[i]));
    }
    EXPECT_LE(worst, op.float_error() * largest);
    worst_ = std::max(worst_, worst / largest);
  }
  void TearDown() override { RecordProperty("worst", std::to_string(worst_ * 1e9) + "e-9"); }

  ThreadPool pool_{2};
  double worst_ = 0;
};

// In reference mode the networks answer ever more often.
TEST_F(PairAttentionVulkan, AnyScale) {
  for (const double scale : {1e3, 1.0, 0.1, 3e-2, 1e-2, 1e-3, 1e-4, 1e-6}) {
    SCOPED_TRACE(scale);
    check(small_config(), [&](Nodes& nodes) { nodes.scale(scale); });
  }
}

TEST_F(PairAttentionVulkan, OneSideMuchShorterThanTheOther) {
  for (const int side : {0, 1})
    for (const double scale : {1e-3, 1e-6, 1e-9})
      check(small_config(),
            [&](Nodes& nodes) { nodes.change(1, side, [&](double x) { return scale * x; }); });
}

TEST_F(PairAttentionVulkan, CoincidingKeyPoints) {
  for (const std::size_t step : {1, 2})
    for (const int sides : {1, 2, 3}) {
      SCOPED_TRACE(sides);
      check(small_config(), [&](Nodes& nodes) {
        for (const int side : {0, 1})
          if (sides >> side & 1) nodes.change(step, side, [](double) { return 0.25; });
      });
    }
}

// Edges between the nodes around the origin.
TEST_F(PairAttentionVulkan, DirectionsShorterThanTheirFloor) {
  for (const double length : {3e-12, 8e-13, 1e-13, 1e-15})
    for (const int sides : {1, 2, 3}) {
      SCOPED_TRACE(std::to_string(sides) + " of length " + std::to_string(length * 1e12) + "e-12");
      check(small_config(), [&](Nodes& nodes) {
        for (const int side : {0, 1})
          if (sides >> side & 1) nodes.change(2, side, [&](double x) { return length * x; });
      });
    }
}

TEST_F(PairAttentionVulkan, AnyNumberOfChannels) {
  const int channels[][4] = {{1, 1, 1, 1}, {5, 7, 1, 1}, {6, 18, 3, 2}, {16, 4, 2, 2}};
  for (const auto& [feature, hidden, div, heads] : channels) {
    SCOPED_TRACE(std::to_string(feature) + " → " + std::to_string(hidden));
    ModelConfig config = small_config();
    config.feature_num_channels = feature;
    config.num_channels = hidden;
    config.div = div;
    config.heads = heads;
    config.predict_head = 1 + hidden % 3;
    config.num_layers = 1;
    ASSERT_TRUE(validate(config));
    check(config);
    check(config, [](Nodes& nodes) { nodes.scale(1e-3); }, 1, {Mode::reference});
  }
}

TEST_F(PairAttentionVulkan, AnyNumberOfNeighbours) {
  for (const int k : {1, 2, 31, 33, 64}) {
    SCOPED_TRACE(k);
    // Few channels: each number of neighbours is a kernel for the driver to compile.
    ModelConfig config;
    config.feature_num_channels = config.num_channels = 2;
    config.div = config.heads = 1;
    config.num_key_points = 66;
    config.re_convert_k = k;
    config.num_layers = 1;
    ASSERT_TRUE(validate(config));
    check(config);
  }
}

// More nodes than the messages of one run.
TEST_F(PairAttentionVulkan, ManyPairs) {
  ModelConfig config;
  config.num_layers = 1;
  check(
      config, [](Nodes& nodes) { nodes.change(97, 0, [](double) { return 0.5; }); }, 190);
}

// A pair's numbers do not depend on what else is in the batch.
TEST_F(PairAttentionVulkan, PairsAreIndependent) {
  const ModelConfig config = small_config();
  for (const auto& op : layers(config, Mode::reference)) {
    Nodes three(config, 3);
    three.change(5, 1, [](double x) { return 1e-3 * x; });
    const std::vector<OpTensor> out = {{Rows::pair_key, 1, op.fiber_out.size(), false, {}, {}}};
    const auto inputs = three.inputs(op);
    const auto together = test::run_op_vulkan(op, three.layout, inputs, out).at(0).values;
    const std::size_t keys = three.layout.key_points;
    for (std::size_t pair = 0; pair < 3; ++pair) {
      std::vector<OpTensor> own = inputs;
      for (OpTensor& tensor : own) {
        const std::size_t rows = keys * tensor.per_row * tensor.width;
        const auto cut = [&](auto& numbers) {
          if (!numbers.empty())
            numbers = {numbers.begin() + pair * rows, numbers.begin() + (pair + 1) * rows};
        };
        cut(tensor.values);
        cut(tensor.indices);
        for (auto& i : tensor.indices) i -= static_cast<std::uint32_t>(pair * keys);
      }
      const auto alone = test::run_op_vulkan(op, Nodes(config).layout, own, out).at(0).values;
      EXPECT_TRUE(std::equal(alone.begin(), alone.end(), together.begin() + pair * alone.size()))
          << "pair " << pair;
    }
  }
}

}  // namespace
}  // namespace bitr
