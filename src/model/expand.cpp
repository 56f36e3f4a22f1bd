#include <map>

#include "model/build.hpp"

namespace bitr::model {
namespace {

using graph::Graph;
using graph::Node;
using graph::Rows;
using graph::TensorId;

class Expander {
 public:
  explicit Expander(const Graph& source) : graph_(source) { graph_.nodes.clear(); }

  void add(const Node& node) {
    if (const auto* layer = std::get_if<ops::AttentionLayer>(&node.op))
      expand(*layer, node);
    else
      graph_.nodes.push_back(node);
  }
  Graph take() { return std::move(graph_); }

 private:
  struct Geometry {
    TensorId lengths, directions;
  };

  // Layers on the same neighbour lists share their edges' geometry.
  Geometry geometry(int sides, TensorId index, TensorId centres, TensorId neighbors) {
    const auto known = geometries_.find(index);
    if (known != geometries_.end()) return known->second;
    const auto info = graph_.tensors[index];
    const std::string name = info.name.substr(0, info.name.find('.'));
    const auto edges = [&](const char* suffix, int width) {
      return graph_.add({.name = name + suffix,
                         .rows = info.rows,
                         .per_row = info.per_row,
                         .width = width,
                         .kind = graph::ElementKind::real,
                         .fiber = {}});
    };
    const Geometry made{edges(".r", sides), edges(".direction", 3 * sides)};
    graph_.append(name + ".geometry", ops::EdgeGeometry{sides}, {centres, neighbors, index},
                  {made.lengths, made.directions});
    return geometries_.emplace(index, made).first->second;
  }

  TensorId convolve(const ops::Convolve& op, const std::string& name, TensorId feature, TensorId index,
                    const Geometry& edges) {
    const auto [rows, k] = std::pair(graph_.tensors[index].rows, graph_.tensors[index].per_row);
    const TensorId out = graph_.add(name, rows, op.fiber_out, k);
    graph_.append(name, op, {feature, index, edges.lengths, edges.directions}, {out});
    return out;
  }

  void expand(const ops::AttentionLayer& layer, const Node& node) {
    const TensorId feature = node.inputs[0], index = node.inputs[1];
    const Geometry edges = geometry(layer.sides, index, node.inputs[2], node.inputs[3]);
    const Rows rows = graph_.tensors[index].rows;
    const int k = graph_.tensors[index].per_row;
    const std::string& name = node.name;

    TensorId values, keys;
    if (layer.scale_degree == 0) {
      values = keys = convolve(layer.values_keys, name + ".vk", feature, index, edges);
    } else {
      values = convolve(layer.values, name + ".v", feature, index, edges);
      keys = convolve(layer.keys, name + ".k", feature, index, edges);
    }
    std::vector<TensorId> inputs = {values, keys};
    if (!layer.zero_centre) {
      const TensorId query = graph_.add(name + ".q", rows, layer.key_fiber);
      graph_.append(name + ".q", layer.query, {feature}, {query});
      inputs.push_back(query);
    }
    const auto per_head = [&](const char* suffix) {
      return graph_.add({.name = name + suffix,
                         .rows = rows,
                         .per_row = k,
                         .width = layer.heads,
                         .kind = graph::ElementKind::real,
                         .fiber = {}});
    };
    const TensorId logits = per_head(".attn_logit"), weights = per_head(".attn");
    const TensorId mixed = graph_.add(name + ".attn_out", rows, layer.value_fiber);
    graph_.append(name + ".attn",
                  ops::Attend{layer.heads, layer.value_fiber, layer.key_fiber, graph_.tensors[values].fiber,
                              graph_.tensors[keys].fiber},
                  inputs, {logits, weights, mixed});

    // A zero centre contributes nothing to the projection, so its columns are left out.
    ops::Linear project = layer.project;
    std::vector<TensorId> parts = {mixed};
    if (layer.zero_centre) {
      project.fiber_in.resize(1);
      for (auto& [d, matrix] : project.weights)
        matrix = matrix.leftCols(layer.value_fiber.channels(d)).eval();
      project.skip.clear();
    } else if (layer.scale_degree == 0) {
      parts.push_back(feature);
    }
    graph_.append(name + ".project", std::move(project), parts, node.outputs);
  }

  Graph graph_;
  std::map<TensorId, Geometry> geometries_;
};

}  // namespace

Graph expand(const Graph& source) {
  Expander expander(source);
  for (const Node& node : source.nodes) expander.add(node);
  return expander.take();
}

}  // namespace bitr::model
