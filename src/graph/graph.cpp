#include "graph/graph.hpp"

#include <set>

namespace bitr::graph {

std::string check_executable(const Graph& graph) {
  std::set<TensorId> made = {graph.positions};
  if (graph.normals != no_tensor) made.insert(graph.normals);
  if (graph.colors != no_tensor) made.insert(graph.colors);
  if (graph.offsets != no_tensor) made.insert(graph.offsets);
  if (graph.truth != no_tensor) made.insert(graph.truth);
  for (const Node& node : graph.nodes) {
    if (std::holds_alternative<ops::AttentionLayer>(node.op))
      return node.name + " is still a composite layer";
    for (TensorId in : node.inputs)
      if (!made.count(in)) return node.name + " reads " + graph.tensors[in].name + " before it is made";
    for (TensorId out : node.outputs)
      if (!made.insert(out).second) return node.name + " makes " + graph.tensors[out].name + " again";
  }
  for (TensorId out : graph.outputs())
    if (!made.count(out)) return "an output of the graph is never made";
  return "";
}

}  // namespace bitr::graph
