#include <algorithm>
#include <map>
#include <set>

#include "model/build.hpp"
#include "model/fold_layers.hpp"

namespace bitr::model {
namespace {

using graph::Graph;
using graph::Node;
using graph::Rows;
using graph::TensorId;

class Folder {
 public:
  Folder(const Graph& source, const ForEach& for_each)
      : source_(source), for_each_(for_each), graph_{source, {}} {
    graph_.nodes.clear();
    for (std::size_t i = 0; i < source.nodes.size(); ++i) {
      for (TensorId id : source.nodes[i].outputs) producer_[id] = i;
      for (TensorId id : source.nodes[i].inputs) consumers_[id].push_back(i);
    }
  }

  DerivedGraph fold() {
    for (std::size_t i = 0; i < source_.nodes.size(); ++i) {
      const Node& node = source_.nodes[i];
      if (merged_.count(i)) continue;
      if (const auto* layer = std::get_if<ops::AttentionLayer>(&node.op))
        fold_layer(*layer, i);
      else if (const auto* sum = std::get_if<ops::CloudSum>(&node.op))
        fold_sum(*sum, i);
      else
        add(node, {i});
    }
    remove_unused_nodes();
    remove_unused_tensors();
    return std::move(graph_);
  }

 private:
  // `from`: what it is made from.
  void add(Node node, std::vector<std::size_t> from) {
    graph_.nodes.push_back(std::move(node));
    graph_.origins.push_back({std::move(from)});
  }

  template <class Op>
  const Node* made_by(TensorId id) const {
    const auto it = producer_.find(id);
    if (it == producer_.end()) return nullptr;
    const Node& node = source_.nodes[it->second];
    return std::holds_alternative<Op>(node.op) ? &node : nullptr;
  }

  // The projected ReLU that alone reads this tensor, if there is one; it is then part of the layer.
  const ops::ProjectedRelu* take_relu(TensorId& output, std::vector<std::size_t>& from) {
    const auto& readers = consumers_[output];
    if (readers.size() != 1) return nullptr;
    const Node& next = source_.nodes[readers.front()];
    const auto* relu = std::get_if<ops::ProjectedRelu>(&next.op);
    if (!relu) return nullptr;
    merged_.insert(readers.front());
    from.push_back(readers.front());
    output = next.outputs.front();
    return relu;
  }

  void fold_layer(const ops::AttentionLayer& layer, std::size_t i) {
    const Node& node = source_.nodes[i];
    TensorId output = node.outputs.front();
    std::vector<std::size_t> from = {i};
    const ops::ProjectedRelu* relu = take_relu(output, from);
    const TensorId feature = node.inputs[0], index = node.inputs[1], centres = node.inputs[2],
                   neighbors = node.inputs[3];
    const std::string name = graph_.tensors[output].name;
    if (layer.sides == 2) {
      add({name, pair_attention(layer, relu, for_each_), {feature, index, centres}, {output}}, from);
      return;
    }
    const ops::PointAttention folded = point_attention(layer, relu);
    if (const Node* input = made_by<ops::InputFeatures>(feature); input && input->inputs.empty()) {
      from.push_back(producer_.at(feature));
      add({name, mean_direction(folded, ops::constant_feature), {centres, index}, {output}}, from);
    } else if (const Node* extend = made_by<ops::ExtendFeatures>(feature); extend && !relu) {
      const auto op = cloud_coefficients(folded, std::get<ops::ExtendFeatures>(extend->op));
      const TensorId coefficients = graph_.add({.name = name + ".coefficients",
                                                .rows = Rows::cloud,
                                                .width = op.layer.coefficient_count(),
                                                .kind = graph::ElementKind::real,
                                                .fiber = {}});
      from.push_back(producer_.at(feature));
      add({name + ".coefficients", op, {extend->inputs[1], extend->inputs[2]}, {coefficients}}, from);
      add({name, op.layer, {extend->inputs[0], index, centres, neighbors, coefficients}, {output}}, from);
    } else {
      add({name, folded, {feature, index, centres, neighbors}, {output}}, from);
    }
  }

  // Every sum with the same softmax becomes one operation, at the place of the last of them.
  void fold_sum(const ops::CloudSum& sum, std::size_t i) {
    const Node& node = source_.nodes[i];
    const Node* softmax = made_by<ops::CloudSoftmax>(node.inputs[0]);
    if (!softmax) return add(node, {i});
    const auto& readers = consumers_[node.inputs[0]];
    if (readers.back() != i) return;
    Node folded{softmax->name, {}, {softmax->inputs[0]}, {}};
    ops::SoftmaxSum op{sum.channels, {}};
    for (std::size_t reader : readers) {
      const Node& part = source_.nodes[reader];
      op.skip.push_back(std::get<ops::CloudSum>(part.op).skip);
      folded.inputs.push_back(part.inputs[1]);
      folded.outputs.push_back(part.outputs[0]);
    }
    folded.op = op;
    std::vector<std::size_t> from = {producer_.at(node.inputs[0])};
    from.insert(from.end(), readers.begin(), readers.end());
    add(std::move(folded), std::move(from));
  }

  void remove_unused_nodes() {
    std::set<TensorId> needed;
    for (const TensorId id : graph_.readable()) needed.insert(id);
    std::vector<Node> nodes;
    std::vector<Origin> origins;
    for (std::size_t i = graph_.nodes.size(); i-- > 0;) {
      Node& node = graph_.nodes[i];
      if (std::none_of(node.outputs.begin(), node.outputs.end(),
                       [&](TensorId id) { return needed.count(id); }))
        continue;
      needed.insert(node.inputs.begin(), node.inputs.end());
      nodes.push_back(std::move(node));
      origins.push_back(std::move(graph_.origins[i]));
    }
    std::reverse(nodes.begin(), nodes.end());
    std::reverse(origins.begin(), origins.end());
    graph_.nodes = std::move(nodes);
    graph_.origins = std::move(origins);
  }

  void remove_unused_tensors() {
    std::set<TensorId> used;
    for (const auto& [role, id] : graph_.inputs) used.insert(id);
    for (const Node& node : graph_.nodes) {
      used.insert(node.inputs.begin(), node.inputs.end());
      used.insert(node.outputs.begin(), node.outputs.end());
    }
    std::map<TensorId, TensorId> renumbered;
    std::vector<graph::TensorInfo> tensors;
    for (TensorId id : used) {
      renumbered[id] = static_cast<TensorId>(tensors.size());
      tensors.push_back(graph_.tensors[id]);
    }
    graph_.tensors = std::move(tensors);
    for (Node& node : graph_.nodes) {
      for (TensorId& id : node.inputs) id = renumbered.at(id);
      for (TensorId& id : node.outputs) id = renumbered.at(id);
    }
    const auto to = [&](TensorId id) { return renumbered.at(id); };
    graph_.inputs.renumber(to);
    graph_.outputs.renumber(to);
    for (TensorId& id : graph_.saved) id = to(id);
  }

  const Graph& source_;
  const ForEach& for_each_;
  DerivedGraph graph_;
  std::map<TensorId, std::size_t> producer_;
  std::map<TensorId, std::vector<std::size_t>> consumers_;
  std::set<std::size_t> merged_;
};

}  // namespace

DerivedGraph fold(const Graph& graph, const ForEach& for_each) { return Folder(graph, for_each).fold(); }

}  // namespace bitr::model
