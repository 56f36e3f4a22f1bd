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
  explicit Expander(const Graph& source) : graph_{source, {}} { graph_.nodes.clear(); }

  void add(const Node& node, std::size_t i) {
    from_ = i;
    if (const auto* layer = std::get_if<ops::AttentionLayer>(&node.op))
      expand(*layer, node);
    else
      append(node.name, node.op, node.inputs, node.outputs);
  }
  DerivedGraph take() { return std::move(graph_); }

 private:
  struct Geometry {
    TensorId lengths, directions;
  };

  void append(std::string name, ops::Op op, std::vector<TensorId> inputs, std::vector<TensorId> outputs,
              LayerPart part = LayerPart::all) {
    graph_.append(std::move(name), std::move(op), std::move(inputs), std::move(outputs));
    graph_.origins.push_back({{from_}, part});
  }

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
    append(name + ".geometry", ops::EdgeGeometry{sides}, {centres, neighbors, index},
           {made.lengths, made.directions});
    return geometries_.emplace(index, made).first->second;
  }

  TensorId convolve(const ops::Convolve& op, const std::string& name, TensorId feature, TensorId index,
                    const Geometry& edges, LayerPart part) {
    const auto [rows, k] = std::pair(graph_.tensors[index].rows, graph_.tensors[index].per_row);
    const TensorId out = graph_.add(name, rows, op.fiber_out, k);
    append(name, op, {feature, index, edges.lengths, edges.directions}, {out}, part);
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
      values = keys =
          convolve(layer.values_keys, name + ".vk", feature, index, edges, LayerPart::values_keys);
    } else {
      values = convolve(layer.values, name + ".v", feature, index, edges, LayerPart::values);
      keys = convolve(layer.keys, name + ".k", feature, index, edges, LayerPart::keys);
    }
    std::vector<TensorId> inputs = {values, keys};
    if (!layer.zero_centre) {
      const TensorId query = graph_.add(name + ".q", rows, layer.key_fiber);
      append(name + ".q", layer.query, {feature}, {query}, LayerPart::query);
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
    append(name + ".attn",
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
    append(name + ".project", std::move(project), parts, node.outputs, LayerPart::project);
  }

  DerivedGraph graph_;
  std::size_t from_ = 0;  // the node that is being added
  std::map<TensorId, Geometry> geometries_;
};

}  // namespace

DerivedGraph expand(const Graph& source) {
  Expander expander(source);
  for (std::size_t i = 0; i < source.nodes.size(); ++i) expander.add(source.nodes[i], i);
  return expander.take();
}

}  // namespace bitr::model
