// Every gradient operation, as defined and folded, on the tensors it meets in a network: in double against
// central differences of the operation it belongs to, in float against double, nothing outside its outputs
// touched, the same bits for any number of threads.
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "model/fold_layers.hpp"
#include "ops/constants.hpp"
#include "support/cases.hpp"
#include "support/cloud_batch.hpp"
#include "support/configurations.hpp"
#include "support/op_run.hpp"
#include "support/symmetry.hpp"
#include "train/training_graph.hpp"

namespace bitr {
namespace {

using graph::TensorId;
using test::Case;
using test::OpTensor;

// What follows from the constants that training changes.
template <class Operation>
void refresh(Operation&) {}
void refresh(ops::MeanDirection& op) { op = model::mean_direction(op.general, op.constant); }

// The operation with its constants moved.
template <class Operation>
Operation moved(const Operation& op, const std::vector<double>& direction, double step) {
  Operation result = ops::zeros_like(op);
  const auto from = ops::constants(const_cast<Operation&>(op)), to = ops::constants(result);
  std::size_t i = 0;
  for (std::size_t s = 0; s < to.size(); ++s)
    for (std::size_t n = 0; n < to[s].size(); ++n) to[s][n] = from[s][n] + step * direction[i++];
  refresh(result);
  return result;
}

double root_mean_square(std::span<const double> values) {
  double sum = 0;
  for (const double x : values) sum += x * x;
  return values.empty() ? 0 : std::sqrt(sum / static_cast<double>(values.size()));
}

std::vector<Case> cases() {
  ModelConfig normals = test::normals_and_colors(), narrow;
  normals.relu_square = true;
  narrow.num_channels = narrow.feature_num_channels = 3;
  narrow.heads = 3;
  narrow.div = 1;
  narrow.num_key_points = 9;
  narrow.re_convert_k = 8;
  narrow.k_neighbor = 5;
  narrow.key_mean_num = 7;
  narrow.num_layers = narrow.feature_num_layers = 1;
  std::vector<Case> all = {{"default_model", {}, {{30, 41}, {27, 26}}},
                           {"duplicates", {}, {{40, 33}}, 3},
                           {"normals", normals, {{29, 31}}},
                           {"normals_duplicates", normals, {{31, 28}, {26, 27}}, 2},
                           {"one_neighbour", test::shallow_model(), {{15, 12}, {9, 20}}},
                           {"narrow", narrow, {{12, 70}}}};
  static const char* const names[] = {"random_0", "random_1", "random_2"};
  const auto random = test::random_configurations(5, std::size(names), 16);
  for (std::size_t i = 0; i < random.size(); ++i)
    all.push_back({names[i], random[i], {{24, 19}, {18, 21}}, i == 1 ? std::size_t{4} : 0});
  return all;
}

constexpr std::array loss_kinds = {ops::LossKind::direct, ops::LossKind::robust, ops::LossKind::official};

class EveryGradient : public testing::TestWithParam<Case> {
 protected:
  void SetUp() override {
    weights_ = test::perturbed_weights(GetParam().config, 3);
    batch_.emplace(random_, GetParam().pairs);
    if (GetParam().duplicates) batch_->add_duplicates(GetParam().duplicates);
    layout_ = batch_->layout(GetParam().config.num_key_points);
  }

  void check(Mode mode, bool as_defined) {
    weights_.mode = mode;
    for (const ops::LossKind kind : loss_kinds) {
      const train::TrainingGraph training = train::training_graph(weights_, kind, as_defined);
      const graph::Graph& graph = training.result.graph;
      ASSERT_EQ(graph::check_executable(graph), "");
      run(training.made);
      for (std::size_t i = training.made.nodes.size(); i < graph.nodes.size(); ++i) {
        const graph::Node& node = graph.nodes[i];
        SCOPED_TRACE(node.name);
        // Another loss changes nothing for the rest.
        if (kind == ops::LossKind::direct || std::holds_alternative<ops::Gradient<ops::Loss>>(node.op) ||
            std::holds_alternative<ops::Gradient<ops::ProjectPose>>(node.op))
          std::visit([&](const auto& op) { check(op, node, graph); }, node.op);
        if (HasFatalFailure()) return;
      }
    }
  }

 private:
  void run(const graph::Graph& graph) {
    cpu::Executor<double> executor(graph, pool_, {.retain = true});
    executor.prepare(layout_);
    for (std::uint32_t pair = 0; pair < layout_.pairs(); ++pair) {
      double* truth = executor.data(graph.input(graph::Input::truth)) + pair * ops::truth_width;
      const auto R = random_.rotation();
      for (int i = 0; i < ops::pose_numbers; ++i) truth[i] = i < 9 ? R[i] : random_.normal();
      test::any_symmetry(random_, pair, truth + ops::pose_numbers);
    }
    batch_->fill(executor);
    executor.run();
    tensors_.clear();
    // Rounded, so that both types read the same numbers.
    for (std::size_t id = 0; id < graph.tensors.size(); ++id)
      tensors_.push_back(test::rounded(test::read(executor, static_cast<TensorId>(id))));
  }

  template <class Operation>
  void check(const Operation&, const graph::Node&, const graph::Graph&) {}

  template <class Operation>
  void check(const ops::Gradient<Operation>& gradient, const graph::Node& node, const graph::Graph& graph) {
    std::vector<OpTensor> inputs, results;
    for (int i = 0; i < gradient.inputs; ++i) inputs.push_back(tensors_[node.inputs[i]]);
    for (int o = 0; o < gradient.outputs; ++o)
      results.push_back(OpTensor::like(graph.tensors[node.inputs[gradient.inputs + o]]));
    if (weights_.mode == Mode::reference || !whole(gradient.op)) return check(gradient, inputs, results);
    // All that the operation reads and makes.
    ops::Gradient<Operation> full = gradient;
    full.grad_outputs.clear();
    full.needs_input_grad.clear();
    for (int i = 0; i < gradient.inputs; ++i)
      if (!inputs[i].index) full.needs_input_grad.push_back(i);
    for (int o = 0; o < gradient.outputs; ++o)
      if (!results[o].index) full.grad_outputs.push_back(o);
    check(full, inputs, results);
  }

  // Operations every input of which has a gradient, whoever asks.
  template <class Operation>
  static bool whole(const Operation&) {
    return std::is_same_v<Operation, ops::EdgeGeometry> || std::is_same_v<Operation, ops::Convolve> ||
           std::is_same_v<Operation, ops::Linear> || std::is_same_v<Operation, ops::Attend> ||
           std::is_same_v<Operation, ops::ProjectedRelu> || std::is_same_v<Operation, ops::CloudSoftmax> ||
           std::is_same_v<Operation, ops::CloudSum> || std::is_same_v<Operation, ops::ExtendFeatures> ||
           std::is_same_v<Operation, ops::MergePairs> || std::is_same_v<Operation, ops::Head>;
  }

  template <class Operation>
  void check(const ops::Gradient<Operation>& gradient, const std::vector<OpTensor>& inputs,
             const std::vector<OpTensor>& results) {
    // The operation's outputs belong to the rounded inputs.
    std::vector<OpTensor> outputs = test::run_op<double>(gradient.op, layout_, inputs, results, pool_);
    std::vector<OpTensor> given = outputs;
    for (OpTensor& tensor : given)
      for (double& x : tensor.values) x = static_cast<float>(random_.normal());
    mask(gradient.op, outputs, given);

    std::vector<OpTensor> reads = inputs, makes;
    reads.insert(reads.end(), outputs.begin(), outputs.end());
    for (const int o : gradient.grad_outputs) reads.push_back(given[o]);
    for (const int i : gradient.needs_input_grad) {
      makes.push_back(inputs[i]);
      makes.back().values.clear();
    }
    if (gradient.constants)
      makes.push_back(
          {graph::Rows::one, 1, static_cast<int>(ops::constant_count(gradient.op)), false, {}, {}});
    const auto exact = test::run_op<double>(gradient, layout_, reads, makes, pool_);
    const auto single = test::run_op<float>(gradient, layout_, reads, makes, pool_);
    for (ThreadPool* pool : {&one_, &three_}) {
      const auto again = test::run_op<float>(gradient, layout_, reads, makes, *pool);
      for (std::size_t i = 0; i < makes.size(); ++i)
        EXPECT_EQ(single[i].values, again[i].values) << "threads change the result";
    }
    // Where a gradient vanishes by symmetry its rounding remains: nothing beside the others.
    double most = 0;
    for (const OpTensor& tensor : exact) most = std::max(most, largest(tensor.values));
    for (std::size_t i = 0; i < makes.size(); ++i) compare(single[i].values, exact[i].values, 1e-2 * most, i);
    if (testing::Test::HasFatalFailure()) return;

    if constexpr (std::is_same_v<Operation, ops::Loss>)
      std::fill(given[0].values.begin(), given[0].values.end(), 1.0 / layout_.pairs());
    const auto value = [&](const Operation& op, const std::vector<OpTensor>& at) {
      const auto made = test::run_op<double>(op, layout_, at, results, pool_);
      Value result;
      for (std::size_t o = 0; o < made.size(); ++o)
        if (std::is_same_v<Operation, ops::Loss> || gradient.grad_output_at(static_cast<int>(o)) >= 0)
          for (std::size_t i = 0; i < made[o].values.size(); ++i) {
            result.sum += made[o].values[i] * given[o].values[i];
            result.terms += std::abs(made[o].values[i] * given[o].values[i]);
          }
      return result;
    };
    for (std::size_t n = 0; n < gradient.needs_input_grad.size(); ++n) {
      const std::size_t input = gradient.needs_input_grad[n];
      SCOPED_TRACE("input " + std::to_string(input));
      differences(exact[n].values, [&](std::vector<double>& direction) {
        // In proportion: short edges change little, and those of length zero stay so.
        for (std::size_t i = 0; i < direction.size(); ++i)
          direction[i] = inputs[input].values[i] * random_.normal();
        return [&](double step) {
          std::vector<OpTensor> at = inputs;
          for (std::size_t i = 0; i < direction.size(); ++i) at[input].values[i] += step * direction[i];
          return value(gradient.op, at);
        };
      });
    }
    if (!gradient.constants) return;
    SCOPED_TRACE("constants");
    differences(exact.back().values, [&](std::vector<double>& direction) {
      std::size_t i = 0;
      for (const auto& span : ops::constants(const_cast<Operation&>(gradient.op)))
        for (std::size_t n = 0; n < span.size(); ++n)
          direction[i++] = std::max(root_mean_square(span), 0.1) * random_.normal();
      return [&](double step) { return value(moved(gradient.op, direction, step), inputs); };
    });
  }

  // No gradient is asked for where the operation has none.
  template <class Operation>
  static void mask(const Operation&, const std::vector<OpTensor>&, std::vector<OpTensor>&) {}
  // An edge of length zero has no direction that could turn.
  static void mask(const ops::EdgeGeometry& op, const std::vector<OpTensor>& outputs,
                   std::vector<OpTensor>& given) {
    for (std::size_t i = 0; i < outputs[0].values.size(); ++i)
      if (outputs[0].values[i] == 0) std::fill_n(given[1].values.begin() + 3 * i, 3, 0.0);
    (void)op;
  }
  // Singular values and determinant are there to be looked at.
  static void mask(const ops::ProjectPose&, const std::vector<OpTensor>&, std::vector<OpTensor>& given) {
    for (std::size_t i = 0; i < given[0].values.size(); ++i)
      if (i % ops::pose_width >= 12) given[0].values[i] = 0;
  }

  static double largest(const std::vector<double>& values) {
    double result = 0;
    for (const double x : values) result = std::max(result, std::abs(x));
    return result;
  }

  void compare(const std::vector<double>& single, const std::vector<double>& exact, double least,
               std::size_t output) {
    double worst = 0;
    for (std::size_t i = 0; i < exact.size(); ++i) {
      ASSERT_TRUE(std::isfinite(single[i]) && std::isfinite(exact[i]))
          << "output " << output << " element " << i;
      worst = std::max(worst, std::abs(single[i] - exact[i]));
    }
    EXPECT_LE(worst, ops::cpu_gradient_error * std::max(least, largest(exact))) << "output " << output;
  }

  // ⟨gradient, u⟩ against the central difference along u. Kinks (LeakyReLU, min) may lie within a step: a
  // smaller one along another direction will not meet them again.
  struct Value {
    double sum = 0, terms = 0;  ///< terms: of their absolute values, to which rounding is in proportion
  };
  template <class Along>
  static void differences(const std::vector<double>& gradient, Along along) {
    constexpr double steps[] = {1e-5, 1e-6, 1e-6, 1e-7, 1e-7, 1e-8, 1e-8};
    std::string seen;
    for (const double step : steps) {
      std::vector<double> direction(gradient.size());
      const auto value = along(direction);
      const Value after = value(step), before = value(-step);
      const double difference = (after.sum - before.sum) / (2 * step);
      double sum = 0, squares = 0;
      for (std::size_t i = 0; i < gradient.size(); ++i) {
        sum += gradient[i] * direction[i];
        squares += std::pow(gradient[i] * direction[i], 2);
      }
      const double rounding = 1e-15 * after.terms / step;
      if (std::abs(sum - difference) <= 2e-6 * std::sqrt(squares) + rounding) return;
      seen += "\n  step " + std::to_string(step * 1e6) + "e-6: gradient " + std::to_string(sum) +
              ", difference " + std::to_string(difference) + ", scale " + std::to_string(std::sqrt(squares));
    }
    ADD_FAILURE() << "not the derivative:" << seen;
  }

 protected:
  Random random_{99};
  model::Weights weights_;
  std::optional<test::CloudBatch> batch_;
  graph::BatchLayout layout_;
  std::vector<OpTensor> tensors_;  // what the forward pass made
  ThreadPool one_{1}, pool_{2}, three_{3};
};

TEST_P(EveryGradient, AsDefined) {
  check(Mode::reference, true);
  check(Mode::scale_exact, true);
}
TEST_P(EveryGradient, Folded) { check(Mode::scale_exact, false); }

INSTANTIATE_TEST_SUITE_P(Cases, EveryGradient, testing::ValuesIn(cases()),
                         [](const auto& c) { return c.param.name; });

// A new operation of training has to take part.
TEST(EveryGradientTest, CoversEveryGradient) {
  std::set<std::size_t> met;
  for (const Case& c : cases())
    for (const bool as_defined : {true, false})
      for (const ops::LossKind kind : loss_kinds)
        for (const auto& node :
             train::training_graph(test::perturbed_weights(c.config, 3), kind, as_defined).result.graph.nodes)
          met.insert(node.op.index());
  const std::size_t first = ops::Op(ops::Loss{}).index();
  for (std::size_t i = first; i < std::variant_size_v<ops::Op>; ++i)
    EXPECT_TRUE(met.count(i)) << "operation " << i;
}

}  // namespace
}  // namespace bitr
