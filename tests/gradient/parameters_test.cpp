// The gradients of a graph's constants on their way back to the model's parameters.
#include <gmock/gmock.h>

#include <algorithm>

#include "core/failure.hpp"
#include "model/architecture.hpp"
#include "model/parameter_gradients.hpp"
#include "support/cases.hpp"
#include "support/cloud_batch.hpp"
#include "support/configurations.hpp"
#include "support/op_run.hpp"
#include "support/random_motion.hpp"
#include "train/training_graph.hpp"

namespace bitr {
namespace {

using testing::HasSubstr;

struct Kind {
  const char* name;
  ModelConfig config;
  bool as_defined;
  friend std::ostream& operator<<(std::ostream& out, const Kind& kind) { return out << kind.name; }
};

// A step of training, up to the gradients of the graph's constants.
class ParameterGradients : public testing::TestWithParam<Kind> {
 protected:
  void SetUp() override {
    weights_ = test::perturbed_weights(GetParam().config, 3);
    training_ = train::training_graph(weights_, ops::LossKind::direct, GetParam().as_defined);
    Random random(5);
    const test::CloudBatch batch(random, {{110, 100}});
    ThreadPool pool(2);
    cpu::Executor<double> executor(training_.result.graph, pool);
    const graph::BatchLayout layout = batch.layout(GetParam().config.num_key_points);
    executor.prepare(layout);
    batch.fill(executor);
    std::vector<double> truth;
    const Pose pose = test::random_pose(random);
    truth.insert(truth.end(), pose.rotation.begin(), pose.rotation.end());
    truth.insert(truth.end(), pose.translation.begin(), pose.translation.end());
    truth.insert(truth.end(), ops::no_symmetry.begin(), ops::no_symmetry.end());
    executor.write(graph::Input::truth, truth);
    executor.run();
    constants_.resize(training_.made.nodes.size());
    for (std::size_t i = 0; i < constants_.size(); ++i)
      if (const graph::TensorId id = training_.result.constants[i]; id != graph::no_tensor)
        constants_[i] = executor.read<double>(id);
  }

  model::Gradients gradients() const {
    return model::parameter_gradients(weights_, training_.whole, training_.made, constants_);
  }
  std::string error() const {
    try {
      gradients();
      return "none";
    } catch (const Failure& failure) {
      EXPECT_EQ(failure.error().code, ErrorCode::internal);
      return failure.what();
    }
  }
  std::vector<std::size_t> nodes_with_constants() const {
    std::vector<std::size_t> nodes;
    for (std::size_t i = 0; i < constants_.size(); ++i)
      if (!constants_[i].empty()) nodes.push_back(i);
    return nodes;
  }

  model::Weights weights_;
  train::TrainingGraph training_;
  std::vector<std::vector<double>> constants_;
};

// Two kinds: the query of a layer whose centre is zero, and what the official code has without using it, the norms of the
// last two-sided layer.
TEST_P(ParameterGradients, OnlyParametersWithoutUseHaveNone) {
  const model::Architecture net = model::architecture(weights_.config);
  const std::string query = "GMAB.q.transform.";
  const auto unused = [&](const std::string& name) {
    return name.starts_with(net.extract.prefix + query) ||
           (name.starts_with(net.pair_network.back().prefix + "GMAB.v.rp.") &&
            name.find(".normalization.") != std::string::npos);
  };
  // Softmax takes no notice of what is the same for all: rounding is left, or nothing.
  std::vector<std::string> rounding = {"predict_head.weight_logit_layer.0.normalization.bias",
                                       "predict_head.weight_logit_layer.1.bias"};
  const ops::InputFeatures& input = net.input;
  if (!input.normals && !input.colors && !input.offsets)
    rounding.push_back(net.extractor.front().prefix + query);
  std::size_t without = 0, with = 0;
  for (const auto& [name, gradient] : gradients()) {
    EXPECT_TRUE(gradient.allFinite()) << name;
    if (std::any_of(rounding.begin(), rounding.end(),
                    [&](const std::string& start) { return name.starts_with(start); }))
      continue;
    EXPECT_EQ(gradient.isZero(0), unused(name)) << name;
    ++(unused(name) ? without : with);
  }
  EXPECT_GT(without, 0u);
  EXPECT_GT(with, without);
}

TEST_P(ParameterGradients, AGradientWithoutAnOriginIsAnError) {
  for (const std::size_t node : nodes_with_constants()) {
    auto& from = training_.made.origins.at(node).nodes;
    const std::vector<std::size_t> kept = from;
    from.clear();
    EXPECT_THAT(error(),
                HasSubstr(training_.made.nodes[node].name + " has a gradient and came from no node"));
    // Neither is a ReLU forgotten that was folded into its layer.
    if (kept.size() > 1 && std::holds_alternative<ops::ProjectedRelu>(training_.whole.nodes[kept[1]].op)) {
      from = {kept.front()};
      EXPECT_THAT(error(), HasSubstr("came from no node"));
    }
    from = kept;
  }
  EXPECT_EQ(error(), "none");
}

TEST_P(ParameterGradients, AParameterWithoutAGradientIsAnError) {
  for (const std::size_t node : nodes_with_constants()) {
    const std::vector<double> kept = std::exchange(constants_[node], {});
    const std::string whole = training_.whole.nodes[training_.made.origins[node].nodes.front()].name;
    EXPECT_THAT(error(), HasSubstr("the parameters of " + whole)) << training_.made.nodes[node].name;
    constants_[node] = kept;
  }
  EXPECT_EQ(error(), "none");
}

// A head's gradient does not go to a layer.
TEST_P(ParameterGradients, AnOriginOfAnotherKindIsAnError) {
  const auto nodes = nodes_with_constants();
  const auto head = std::find_if(nodes.begin(), nodes.end(), [&](std::size_t node) {
    return std::holds_alternative<ops::Head>(training_.made.nodes[node].op);
  });
  ASSERT_NE(head, nodes.end());
  training_.made.origins[*head].nodes = training_.made.origins[nodes.front()].nodes;
  EXPECT_THAT(error(), HasSubstr("came from no node"));
}

std::vector<Kind> kinds() {
  ModelConfig shallow = test::shallow_model();
  // One neighbor's weight is 1, whatever query and key.
  shallow.k_neighbor = shallow.key_mean_num = shallow.re_convert_k = 8;
  shallow.num_key_points = 16;
  return {{"folded", {}, false},
          {"as_defined", {}, true},
          {"trained_folded", test::trained_model(), false},
          {"trained_as_defined", test::trained_model(), true},
          {"without_hidden_layers_folded", shallow, false},
          {"without_hidden_layers_as_defined", shallow, true}};
}
INSTANTIATE_TEST_SUITE_P(Graphs, ParameterGradients, testing::ValuesIn(kinds()),
                         [](const auto& kind) { return kind.param.name; });

}  // namespace
}  // namespace bitr
