#include "train/training_graph.hpp"

#include "core/failure.hpp"
#include "model/build.hpp"

namespace bitr::train {
namespace {

using graph::Graph;
using graph::Input;
using graph::Output;
using graph::Rows;
using graph::TensorId;

void append_loss(Graph& graph, ops::LossKind kind) {
  const TensorId truth = graph.add_input(
      Input::truth, {.name = "truth", .rows = Rows::pair, .width = ops::truth_width, .fiber = {}});
  const TensorId loss = graph.add_output(
      Output::loss, {.name = "loss", .rows = Rows::pair, .width = ops::loss_terms, .fiber = {}});
  const TensorId from =
      kind == ops::LossKind::official ? graph.output(Output::pose) : graph.find("head.pieces");
  graph.append("loss", ops::Loss{kind}, {from, truth, graph.output(Output::key_points)}, {loss});
}

}  // namespace

TrainingGraph training_graph(const model::Weights& weights, ops::LossKind loss, bool as_defined,
                             const ForEach& for_each) {
  if (!as_defined && weights.mode == Mode::reference)
    throw Failure(ErrorCode::unsupported,
                  "a model in reference mode is trained as defined only; scale-exact is for folded training");
  TrainingGraph training;
  training.whole = model::build_graph(weights, weights.mode);
  training.made = as_defined ? model::expand(training.whole) : model::fold(training.whole, for_each);
  append_loss(training.made, loss);
  training.result = graph::differentiate(training.made);
  return training;
}

}  // namespace bitr::train
