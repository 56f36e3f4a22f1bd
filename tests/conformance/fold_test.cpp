// The folded network against the network as defined, operation by operation, in double precision: many
// configurations, norms that do something, duplicate points.
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "model/build.hpp"
#include "support/cloud_batch.hpp"
#include "support/configurations.hpp"
#include "support/op_run.hpp"

namespace bitr {
namespace {

using test::OpTensor;

// Every folded operation on the tensors of the network as defined, against the tensors it should give:
// nothing that an earlier operation rounded, and no neighbour that it exchanged, is blamed on a later one.
class FoldEqualsDefinition : public testing::TestWithParam<int> {
 protected:
  // What each operation may differ by, over its output's largest entry.
  struct Bounds {
    double points, pairs;
    double least_length;  ///< key points with shorter edges (but for 0) are left out
  };

  void check(Mode mode, Bounds bounds, std::size_t duplicates, double scale) {
    const auto configs = test::random_configurations(500 + GetParam(), 5, GetParam() % 3 == 0 ? 64 : 20);
    Random random(700 + GetParam());
    for (const ModelConfig& config : configs) {
      SCOPED_TRACE(model::to_json(config));
      const auto least = static_cast<std::size_t>(
          std::max(config.k_neighbor * config.neighbor_dilation + 1, config.key_mean_num));
      test::CloudBatch batch(random, {{least, least + 7}, {least + 1, least}});
      if (duplicates) batch.add_duplicates(duplicates);
      batch.scale(scale);
      compare(model::build_graph(test::perturbed_weights(config, random.bits()), mode), config, batch,
              bounds);
    }
    RecordProperty("points", std::to_string(worst_.points * 1e15) + "e-15");
    RecordProperty("pairs", std::to_string(worst_.pairs * 1e15) + "e-15");
  }

  void compare(const graph::Graph& whole, const ModelConfig& config, const test::CloudBatch& batch,
               const Bounds& bounds) {
    cpu::Executor<double> defined(model::expand(whole), pool_, {.retain = true});
    batch.run(defined, config.num_key_points);
    const graph::BatchLayout layout = batch.layout(config.num_key_points);
    const graph::Graph folded = model::fold(whole);
    std::map<std::string, OpTensor> made;  // what only the folded network has
    int compared = 0;
    for (const graph::Node& node : folded.nodes) {
      std::vector<OpTensor> inputs, outputs;
      for (const auto id : node.inputs) {
        const auto own = made.find(folded.tensors[id].name);
        inputs.push_back(own == made.end() ? read(defined, folded.tensors[id].name) : own->second);
      }
      for (const auto id : node.outputs) outputs.push_back(OpTensor::like(folded.tensors[id]));
      const auto results = test::run_op<double>(node.op, layout, inputs, outputs, pool_);
      for (std::size_t i = 0; i < results.size(); ++i) {
        const std::string& name = folded.tensors[node.outputs[i]].name;
        if (defined.graph().find(name) == graph::no_tensor) {
          made[name] = results[i];
          continue;
        }
        const OpTensor truth = read(defined, name);
        ++compared;
        if (name == "key.feat" && shortest(read(defined, "key.r")) < bounds.least_length) continue;
        if (truth.index) {
          EXPECT_EQ(results[i].indices, truth.indices) << name;
          continue;
        }
        const Eigen::Map<const Eigen::ArrayXd> x(results[i].values.data(), results[i].values.size()),
            y(truth.values.data(), truth.values.size());
        ASSERT_TRUE(x.allFinite() && y.allFinite()) << name;
        const double error = (x - y).abs().maxCoeff() / std::max(y.abs().maxCoeff(), 1e-300);
        const bool pairs = std::holds_alternative<ops::PairAttention>(node.op);
        EXPECT_LE(error, pairs ? bounds.pairs : bounds.points) << name;
        (pairs ? worst_.pairs : worst_.points) = std::max(pairs ? worst_.pairs : worst_.points, error);
      }
    }
    EXPECT_GE(compared, 12 + config.num_layers + config.feature_num_layers);
  }

  static OpTensor read(const graph::Executor& executor, const std::string& name) {
    return test::read(executor, executor.graph().find(name));
  }

  static double shortest(const OpTensor& lengths) {
    double least = 1e300;
    for (const double r : lengths.values)
      if (r > 0) least = std::min(least, r);
    return least;
  }

  ThreadPool pool_{2};
  Bounds worst_{0, 0, 0};
};

TEST_P(FoldEqualsDefinition, InScaleExactMode) { check(Mode::scale_exact, {1e-11, 1e-11, 0}, 0, 1); }
TEST_P(FoldEqualsDefinition, WithDuplicatePoints) { check(Mode::scale_exact, {1e-11, 1e-11, 0}, 3, 1); }

// The fold drops the one-sided LayerNorms' eps, relative to the norm's input eps / (2 r² var w): with eps =
// 1e-8, the initial var w of 2 and edges of 0.05 or more in clouds of size 60, at most 1e-6, which a layer
// can amplify. Two-sided layers keep the eps but take slopes near their sectors' ends from the side that eps
// = 0 gives (sector_table_test).
TEST_P(FoldEqualsDefinition, UpToTheEpsInReferenceMode) { check(Mode::reference, {1e-5, 1e-4, 0.05}, 0, 30); }

INSTANTIATE_TEST_SUITE_P(Seeds, FoldEqualsDefinition, testing::Range(0, 6));

}  // namespace
}  // namespace bitr
