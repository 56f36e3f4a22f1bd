// What a training step runs: the network, the loss and the gradient of both, as one graph.
#pragma once

#include "core/for_each.hpp"
#include "graph/differentiate.hpp"
#include "model/build.hpp"
#include "ops/loss.hpp"

namespace bitr::train {

struct TrainingGraph {
  graph::Graph whole;            ///< build_graph(weights)
  model::DerivedGraph made;      ///< `whole`, folded or expanded, and the loss
  graph::Differentiated result;  ///< `made` and its gradient
};

/// In the weights' mode. Throws Failure (`unsupported`) for a folded graph in reference mode: the fold drops
/// eps that are part of its gradient.
TrainingGraph training_graph(const model::Weights& weights, ops::LossKind loss, bool as_defined,
                             const ForEach& for_each = one_by_one);

}  // namespace bitr::train
