// Every operation of the network, as defined and folded, on the tensors it meets there: the CPU in float, and
// Vulkan where the operation runs there, against the CPU in double, within the operation's bound, nothing
// outside its outputs touched, the same bits for any number of threads.
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "model/build.hpp"
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
  const ModelConfig normals = test::normals_and_colors(), trained = test::trained_model();
  return {{"least_points", {}, {{25, 25}}},
          {"one_more", {}, {{26, 25}}},
          {"ragged", {}, {{25, 333}, {1025, 31}, {64, 65}}},
          {"normals_ragged", normals, {{129, 25}, {26, 700}}},
          {"duplicates", {}, {{90, 130}}, 3},
          {"normals_duplicates", normals, {{70, 41}}, 2},
          {"one_neighbour", test::shallow_model(), {{2, 3}, {9, 2}}},
          {"wide", test::wide_model(12), {{65, 70}}, 5},
          {"trained", trained, {{97, 333}, {1030, 98}}},
          {"trained_duplicates", trained, {{150, 97}}, 3},
          {"chunk_edges", {}, {{1024, 1023}, {64, 2049}}}};
}

class EveryOp : public testing::TestWithParam<Case> {
 protected:
  void SetUp() override {
    weights_ = test::perturbed_weights(GetParam().config, 3);
    Random random(99);
    batch_.emplace(random, GetParam().pairs);
    if (GetParam().duplicates) batch_->add_duplicates(GetParam().duplicates);
  }

  void check(const graph::Graph& graph, bool on_vulkan) {
    cpu::Executor<double> executor(graph, pool_, {.retain = true});
    const int keys = GetParam().config.num_key_points;
    batch_->run(executor, keys);
    const graph::BatchLayout layout = batch_->layout(keys);
    for (const graph::Node& node : graph.nodes) {
      SCOPED_TRACE(node.name);
      std::vector<OpTensor> inputs, outputs;
      for (const auto id : node.inputs) inputs.push_back(test::rounded(test::read(executor, id)));
      for (const auto id : node.outputs) outputs.push_back(OpTensor::like(graph.tensors[id]));
      const auto single = test::run_op<float>(node.op, layout, inputs, outputs, pool_);
      const auto exact = test::run_op<double>(node.op, layout, inputs, outputs, pool_);
      const auto again = test::run_op<float>(node.op, layout, inputs, outputs, three_);
      for (std::size_t i = 0; i < outputs.size(); ++i) {
        EXPECT_EQ(single[i].values, again[i].values) << "threads change the result";
        EXPECT_EQ(single[i].indices, again[i].indices) << "threads change the result";
        if (!outputs[i].index)
          compare(single[i].values, exact[i].values, node, graph.tensors[node.outputs[i]].name);
      }
      if (!on_vulkan) continue;
      SCOPED_TRACE("on Vulkan");
      const auto device = test::run_op_vulkan(node.op, layout, inputs, outputs);
      for (std::size_t i = 0; i < device.size(); ++i) {
        EXPECT_EQ(device[i].indices, single[i].indices) << graph.tensors[node.outputs[i]].name;
        if (!outputs[i].index)
          compare(device[i].values, exact[i].values, node, graph.tensors[node.outputs[i]].name);
      }
    }
  }

  void compare(const std::vector<double>& single, const std::vector<double>& exact, const graph::Node& node,
               const std::string& tensor) {
    double worst = 0, largest = 0;
    for (std::size_t i = 0; i < exact.size(); ++i) {
      ASSERT_TRUE(std::isfinite(single[i]) && std::isfinite(exact[i])) << tensor << " element " << i;
      worst = std::max(worst, std::abs(single[i] - exact[i]));
      largest = std::max(largest, std::abs(exact[i]));
    }
    if (std::holds_alternative<ops::ProjectPose>(node.op))
      return;  // as well determined as its rotation: pose_test
    EXPECT_LE(worst, ops::float_error(node.op) * largest) << tensor;
    auto& record = worst_[node.op.index()];
    if (largest > 0) record = std::max(record, worst / largest);
  }
  void TearDown() override {
    for (const auto& [op, worst] : worst_)
      RecordProperty("op" + std::to_string(op), std::to_string(worst * 1e9) + "e-9");
  }

  model::Weights weights_;
  std::optional<test::CloudBatch> batch_;
  ThreadPool pool_{2}, three_{3};
  std::map<std::size_t, double> worst_;
};

TEST_P(EveryOp, AsDefined) { check(model::expand(model::build_graph(weights_, Mode::reference)), false); }
TEST_P(EveryOp, Folded) {
  for (const Mode mode : {Mode::reference, Mode::scale_exact})
    check(model::fold(model::build_graph(weights_, mode)), test::vulkan() != nullptr);
}

INSTANTIATE_TEST_SUITE_P(Cases, EveryOp, testing::ValuesIn(cases()),
                         [](const auto& c) { return c.param.name; });

// A new operation has to take part, or stand alone: those are tested in kernels_test.
TEST(EveryOpTest, CoversEveryOperation) {
  std::set<std::size_t> met = {ops::Op(ops::CgProduct{}).index(), ops::Op(ops::NeighbourAttention{}).index()};
  for (const Case& c : cases()) {
    const auto whole = model::build_graph(test::perturbed_weights(c.config, 3), Mode::reference);
    for (const graph::Graph& graph : {model::expand(whole), model::fold(whole)})
      for (const auto& node : graph.nodes) met.insert(node.op.index());
  }
  // From the loss on, what a graph that trains holds besides.
  for (std::size_t i = 1; i < ops::Op(ops::Loss{}).index(); ++i)
    EXPECT_TRUE(met.count(i)) << "operation " << i;
  EXPECT_TRUE(std::holds_alternative<ops::AttentionLayer>(ops::Op{}));  // index 0 is the composite
}

}  // namespace
}  // namespace bitr
