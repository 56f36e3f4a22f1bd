// Reverse-mode differentiation of a graph: the gradient is a graph, too.
#pragma once

#include "graph/graph.hpp"

namespace bitr::graph {

struct Differentiated {
  Graph graph;  ///< the nodes of the given one, then those of the gradient
  /// Per node of the given graph: T[1, constant_count], the gradient of its constants; no_tensor if it has
  /// none that the loss depends on.
  std::vector<TensorId> constants;
};

/// Appends what makes the gradient of the graph's loss (its Output::loss, made by an ops::Loss node) with respect
/// to every operation's constants. The graph's inputs have no gradient; neighbour lists count as constant.
/// The constants' gradients stay readable after a run; `graph` must be executable (check_executable).
Differentiated differentiate(Graph graph);

}  // namespace bitr::graph
