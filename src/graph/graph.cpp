#include "graph/graph.hpp"

#include <set>

namespace bitr::graph {

Node::Node(std::string its_name, ops::Op its_op, std::vector<TensorId> reads, std::vector<TensorId> makes)
    : name(std::move(its_name)), op(std::move(its_op)), inputs(std::move(reads)), outputs(std::move(makes)) {}
Node::Node(const Node&) = default;
Node::Node(Node&&) noexcept = default;
Node& Node::operator=(const Node&) = default;
Node& Node::operator=(Node&&) noexcept = default;
Node::~Node() = default;

TensorId Graph::add(TensorInfo info) {
  tensors.push_back(std::move(info));
  return static_cast<TensorId>(tensors.size()) - 1;
}

TensorId Graph::add(std::string name, Rows rows, const irreps::Fiber& fiber, int per_row) {
  return add({std::move(name), rows, per_row, fiber.size(), ElementKind::real, fiber});
}

void Graph::append(std::string name, ops::Op op, std::vector<TensorId> reads, std::vector<TensorId> makes) {
  nodes.emplace_back(std::move(name), std::move(op), std::move(reads), std::move(makes));
}

TensorId Graph::add_input(Input role, TensorInfo info) { return inputs.set(role, add(std::move(info))); }

TensorId Graph::add_output(Output role, TensorInfo info) { return outputs.set(role, add(std::move(info))); }

std::vector<TensorId> Graph::readable() const {
  std::vector<TensorId> all = saved;
  for (const auto& [role, id] : outputs) all.push_back(id);
  return all;
}

TensorId Graph::find(const std::string& name) const {
  for (std::size_t i = 0; i < tensors.size(); ++i)
    if (tensors[i].name == name) return static_cast<TensorId>(i);
  return no_tensor;
}

std::string check_executable(const Graph& graph) {
  std::set<TensorId> made;
  for (const auto& [role, id] : graph.inputs) made.insert(id);
  for (const Node& node : graph.nodes) {
    if (std::holds_alternative<ops::AttentionLayer>(node.op))
      return node.name + " is still a composite layer";
    for (TensorId in : node.inputs)
      if (!made.count(in)) return node.name + " reads " + graph.tensors[in].name + " before it is made";
    for (TensorId out : node.outputs)
      if (!made.insert(out).second) return node.name + " makes " + graph.tensors[out].name + " again";
  }
  for (TensorId out : graph.readable())
    if (!made.count(out)) return "an output of the graph is never made";
  return "";
}

}  // namespace bitr::graph
