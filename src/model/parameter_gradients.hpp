// Gradients of the parameters, by name, from those of the constants of a graph made from them.
#pragma once

#include "core/for_each.hpp"
#include "model/build.hpp"

namespace bitr::model {

using Gradients = std::map<std::string, Eigen::MatrixXd>;

/// `whole`: build_graph(weights, …). `made`: expand(whole) or fold(whole), and nodes behind them. `constants`:
/// per node of `made`, the gradient of its constants in the order of ops/constants.hpp; empty where there is
/// none. Throws Failure (`internal`) if a parameter that the model uses is left without a gradient, or a
/// gradient belongs to no parameter. Zero for parameters that the model does not use: the official state dict
/// has queries for layers whose centre has no features.
Gradients parameter_gradients(const Weights& weights, const graph::Graph& whole, const DerivedGraph& made,
                              const std::vector<std::vector<double>>& constants,
                              const ForEach& for_each = one_by_one);

}  // namespace bitr::model
