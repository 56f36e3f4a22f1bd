// Gradients of the parameters, by name, from those of the constants of a graph made from them.
#pragma once

#include "core/for_each.hpp"
#include "graph/graph.hpp"
#include "model/weights.hpp"

namespace bitr::model {

using Gradients = std::map<std::string, Eigen::MatrixXd>;

/// `whole`: build_graph(weights, …). `made`: expand(whole) or fold(whole). `constants`: per node of `made`,
/// the gradient of its constants in the order of ops/constants.hpp; empty where there is none, which counts
/// as 0.
Gradients parameter_gradients(const Weights& weights, const graph::Graph& whole, const graph::Graph& made,
                              const std::vector<std::vector<double>>& constants,
                              const ForEach& for_each = one_by_one);

}  // namespace bitr::model
