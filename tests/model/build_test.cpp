// The network as a graph, and what its two passes make of it.
#include "model/build.hpp"

#include <gtest/gtest.h>

#include <map>
#include <set>
#include <string>

#include "model/load.hpp"
#include "support/configurations.hpp"

namespace bitr {
namespace {

using graph::Graph;

template <class Op>
std::size_t count(const Graph& graph) {
  std::size_t n = 0;
  for (const auto& node : graph.nodes) n += std::holds_alternative<Op>(node.op);
  return n;
}

// Widths of tensors agree with their fibers, and ids are in range.
void expect_consistent(const Graph& graph, const std::string& what) {
  std::set<std::string> names;
  for (const auto& info : graph.tensors) {
    EXPECT_TRUE(names.insert(info.name).second) << what << ": two tensors are called " << info.name;
    EXPECT_TRUE(info.fiber.degrees() == 0 || info.fiber.size() == info.width) << what << ": " << info.name;
    EXPECT_GT(info.width, 0) << what << ": " << info.name;
    EXPECT_GT(info.per_row, 0) << what << ": " << info.name;
  }
  const auto in_range = [&](graph::TensorId id) {
    return id >= 0 && id < static_cast<int>(graph.tensors.size());
  };
  for (const auto& node : graph.nodes) {
    for (const auto id : node.inputs) EXPECT_TRUE(in_range(id)) << what << ": " << node.name;
    for (const auto id : node.outputs) EXPECT_TRUE(in_range(id)) << what << ": " << node.name;
    EXPECT_FALSE(node.outputs.empty()) << what << ": " << node.name;
  }
  for (const auto& [role, id] : graph.inputs) EXPECT_TRUE(in_range(id)) << what;
  for (const auto& [role, id] : graph.outputs) EXPECT_TRUE(in_range(id)) << what;
  EXPECT_TRUE(graph.inputs.has(graph::Input::positions)) << what;
  EXPECT_TRUE(graph.outputs.has(graph::Output::key_points) && graph.outputs.has(graph::Output::pose)) << what;
}

TEST(BuildGraph, HoldsWholeLayersThatCannotRunYet) {
  const auto weights = model::initial_weights({}, 0, Mode::scale_exact);
  const Graph graph = model::build_graph(weights, Mode::scale_exact);
  expect_consistent(graph, "built");
  EXPECT_EQ(count<ops::AttentionLayer>(graph), 9u);
  EXPECT_NE(graph::check_executable(graph), "");
}

TEST(Expand, LeavesOnlyTheDefinitionsOperations) {
  for (const ModelConfig& config : test::random_configurations(11, 25)) {
    const std::string what = model::to_json(config);
    const Graph source =
        model::build_graph(model::initial_weights(config, 0, Mode::reference), Mode::reference);
    const Graph graph = model::expand(source);
    expect_consistent(graph, what);
    EXPECT_EQ(graph::check_executable(graph), "") << what;
    const std::size_t layers = count<ops::AttentionLayer>(source);
    EXPECT_EQ(layers, static_cast<std::size_t>(config.num_layers + config.feature_num_layers + 5)) << what;
    EXPECT_EQ(count<ops::Attend>(graph), layers) << what;
    EXPECT_EQ(count<ops::Convolve>(graph), layers + 1) << what;    // the last layer has two
    EXPECT_EQ(count<ops::EdgeGeometry>(graph), 3u) << what;        // points, key points, pairs
    EXPECT_EQ(count<ops::Linear>(graph), 2 * layers - 1) << what;  // key points have no query
    EXPECT_EQ(count<ops::PointAttention>(graph) + count<ops::PairAttention>(graph), 0u) << what;
  }
}

TEST(Fold, LeavesAFewFusedOperations) {
  for (const ModelConfig& config : test::random_configurations(12, 25)) {
    const std::string what = model::to_json(config);
    const Graph source =
        model::build_graph(model::initial_weights(config, 0, Mode::scale_exact), Mode::scale_exact);
    const Graph graph = model::fold(source);
    expect_consistent(graph, what);
    EXPECT_EQ(graph::check_executable(graph), "") << what;
    const bool constant = !config.return_normals && !config.get_color;
    const auto pair_layers = static_cast<std::size_t>(config.num_layers) + 1;
    const auto point_layers = static_cast<std::size_t>(config.feature_num_layers) + 4;
    EXPECT_EQ(count<ops::PairAttention>(graph), pair_layers) << what;
    EXPECT_EQ(count<ops::MeanDirection>(graph), constant ? 1u : 0u) << what;
    EXPECT_EQ(count<ops::PointAttention>(graph), point_layers - (constant ? 1 : 0)) << what;
    EXPECT_EQ(count<ops::CloudCoefficients>(graph), 1u) << what;
    EXPECT_EQ(count<ops::SoftmaxSum>(graph), 2u) << what;
    EXPECT_EQ(count<ops::Knn>(graph), 3u) << what;
    EXPECT_EQ(count<ops::InputFeatures>(graph), constant ? 0u : 1u) << what;
    EXPECT_EQ(count<ops::Head>(graph) + count<ops::ProjectPose>(graph) + count<ops::MergePairs>(graph), 3u)
        << what;
    // Nothing else is left.
    EXPECT_EQ(graph.nodes.size(), pair_layers + point_layers + 9 + (constant ? 0 : 1)) << what;
    for (const auto& node : graph.nodes)
      EXPECT_FALSE(std::holds_alternative<ops::AttentionLayer>(node.op)) << what << ": " << node.name;
  }
}

TEST(Fold, TheOfficialNetworkIsUnderThirtyOperations) {
  ModelConfig normals;
  normals.return_normals = true;
  for (const ModelConfig& config : {ModelConfig{}, normals}) {
    const auto weights = model::initial_weights(config, 0, Mode::scale_exact);
    EXPECT_LE(model::fold(model::build_graph(weights, Mode::scale_exact)).nodes.size(), 30u);
  }
}

TEST(Fold, NoTensorIsLeftUnread) {
  const auto weights = model::initial_weights({}, 0, Mode::scale_exact);
  const Graph graph = model::fold(model::build_graph(weights, Mode::scale_exact));
  std::set<graph::TensorId> used;
  for (const auto& [role, id] : graph.outputs) used.insert(id);
  std::set<graph::TensorId> side_results;  // an operation's with another output that is read
  for (const auto& node : graph.nodes) {
    used.insert(node.inputs.begin(), node.inputs.end());
    if (node.outputs.size() > 1) side_results.insert(node.outputs.begin(), node.outputs.end());
  }
  for (std::size_t id = 0; id < graph.tensors.size(); ++id)
    EXPECT_TRUE(used.count(static_cast<int>(id)) || side_results.count(static_cast<int>(id)))
        << graph.tensors[id].name;
}

// Tensors that only the unfolded graph needs go, and those behind them get other numbers.
TEST(Fold, PortsKeepTheirTensors) {
  ModelConfig config;
  config.return_normals = config.get_color = config.centroid_offset = true;
  const auto weights = model::initial_weights(config, 0, Mode::scale_exact);
  Graph source = model::build_graph(weights, Mode::scale_exact);
  for (const auto role : {graph::Input::normals, graph::Input::colors, graph::Input::offsets}) {
    const graph::TensorId old = source.input(role), last = source.add_input(role, source.tensors[old]);
    source.tensors[old].name += " of old";
    for (auto& node : source.nodes)
      for (graph::TensorId& id : node.inputs)
        if (id == old) id = last;
  }
  const Graph graph = model::fold(source);
  EXPECT_EQ(graph::check_executable(graph), "");
  EXPECT_LT(graph.tensors.size(), source.tensors.size());
  const auto name = [&](graph::TensorId id) { return graph.tensors.at(id).name; };
  EXPECT_EQ(name(graph.input(graph::Input::positions)), "positions");
  EXPECT_EQ(name(graph.input(graph::Input::normals)), "normals");
  EXPECT_EQ(name(graph.input(graph::Input::colors)), "colors");
  EXPECT_EQ(name(graph.input(graph::Input::offsets)), "offsets");
  EXPECT_EQ(graph.input(graph::Input::truth), graph::no_tensor);
  EXPECT_EQ(name(graph.output(graph::Output::key_points)), "key.points");
  EXPECT_EQ(name(graph.output(graph::Output::pose)), "out.pose");
  EXPECT_EQ(graph.output(graph::Output::loss), graph::no_tensor);
  for (const auto& node : graph.nodes) {
    if (!std::holds_alternative<ops::InputFeatures>(node.op)) continue;
    EXPECT_EQ(node.inputs, (std::vector{graph.input(graph::Input::colors), graph.input(graph::Input::normals),
                                        graph.input(graph::Input::offsets)}));
  }
}

TEST(CheckExecutable, FindsEachFault) {
  const auto weights = model::initial_weights({}, 0, Mode::scale_exact);
  const Graph good = model::fold(model::build_graph(weights, Mode::scale_exact));
  ASSERT_EQ(graph::check_executable(good), "");
  Graph swapped = good;
  std::swap(swapped.nodes[0], swapped.nodes[1]);
  EXPECT_NE(graph::check_executable(swapped).find("before it is made"), std::string::npos);
  Graph twice = good;
  twice.nodes.push_back(twice.nodes.back());
  EXPECT_NE(graph::check_executable(twice).find("again"), std::string::npos);
  Graph cut = good;
  cut.nodes.pop_back();
  EXPECT_NE(graph::check_executable(cut).find("never made"), std::string::npos);
}

}  // namespace
}  // namespace bitr
