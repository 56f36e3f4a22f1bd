// The network of a model as a graph, layer by layer, and the two passes that make it executable.
#pragma once

#include "core/for_each.hpp"
#include "graph/graph.hpp"
#include "model/weights.hpp"

namespace bitr::model {

/// The network with whole attention layers (ops/attention_layer.hpp) as single nodes. `mode` sets the norms'
/// eps.
graph::Graph build_graph(const Weights& weights, Mode mode);

/// An attention layer's constants, part by part; `all` of them where a node stands for the whole layer.
enum class LayerPart : std::uint8_t { all, values_keys, values, keys, query, project };

/// What a node was made from.
struct Origin {
  std::vector<std::size_t> nodes;   ///< those of the source graph whose work it does, or a part of it
  LayerPart part = LayerPart::all;  ///< which part of the attention layer among them, if there is one
};

/// A graph made from another, and where its nodes came from.
struct DerivedGraph : graph::Graph {
  std::vector<Origin> origins;  ///< for the first nodes, those that came from the source
};

/// As defined: each attention layer becomes edge geometry, convolutions, linear maps and attention. Its
/// tensors carry the stage names of the definition ("fe.g0.vk", "fe.g0.attn", …).
DerivedGraph expand(const graph::Graph& graph);

/// Folded: the same function in far less arithmetic.
///   one-sided layers (+ projected ReLU)   → point_attention; mean_direction when the input is one constant
///   extended features + key regression    → cloud_coefficients + point_attention on the points' own features
///   two-sided layers (+ projected ReLU)   → pair_attention
///   softmax and sums over clouds          → softmax_sum
/// Exact but for the one-sided LayerNorms' eps, which is dropped for edges of positive length. Most of the
/// work is the sector tables: `for_each` may share it out.
DerivedGraph fold(const graph::Graph& graph, const ForEach& for_each = one_by_one);

}  // namespace bitr::model
