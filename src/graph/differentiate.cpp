#include "graph/differentiate.hpp"

#include <map>

#include "ops/constants.hpp"

namespace bitr::graph {
namespace {

class Differentiator {
 public:
  explicit Differentiator(Graph graph) : result_{std::move(graph), {}} {}

  Differentiated run() {
    const std::size_t nodes = graph().nodes.size();
    result_.constants.assign(nodes, no_tensor);
    find_dependent(nodes);
    // A gradient and a sum for each at most: nodes stay where they are.
    graph().nodes.reserve(2 * nodes + graph().tensors.size());
    for (std::size_t i = nodes; i-- > 0;) {
      const Node& node = graph().nodes[i];
      std::visit([&](const auto& op) { differentiate(op, node, i); }, node.op);
    }
    return std::move(result_);
  }

 private:
  Graph& graph() { return result_.graph; }

  // Tensors that change with some operation's constants.
  void find_dependent(std::size_t nodes) {
    dependent_.assign(graph().tensors.size(), false);
    for (std::size_t i = 0; i < nodes; ++i) {
      const Node& node = graph().nodes[i];
      bool depends = std::visit([](const auto& op) { return ops::constant_count(op) > 0; }, node.op);
      for (TensorId id : node.inputs) depends = depends || dependent_[id];
      for (TensorId id : node.outputs)
        dependent_[id] = depends && graph().tensors[id].kind == ElementKind::real;
    }
  }

  template <class Operation>
  void differentiate(const Operation& op, const Node& node, std::size_t i) {
    if constexpr (ops::has_gradient<Operation>::value) {
      ops::Gradient<Operation> gradient{.op = op,
                                        .inputs = static_cast<int>(node.inputs.size()),
                                        .outputs = static_cast<int>(node.outputs.size()),
                                        .grad_outputs = {},
                                        .needs_input_grad = {},
                                        .constants = ops::constant_count(op) > 0};
      std::vector<TensorId> inputs = node.inputs, outputs;
      inputs.insert(inputs.end(), node.outputs.begin(), node.outputs.end());
      for (int o = 0; o < gradient.outputs; ++o)
        if (const TensorId sum = total(node.outputs[o]); sum != no_tensor) {
          gradient.grad_outputs.push_back(o);
          inputs.push_back(sum);
        }
      // The loss is where gradients come from; what does not lead to it has none.
      if (gradient.grad_outputs.empty() && !std::is_same_v<Operation, ops::Loss>) return;
      for (int n = 0; n < gradient.inputs; ++n) {
        const TensorId id = node.inputs[n];
        if (!dependent_[id]) continue;
        TensorInfo info = graph().tensors[id];
        info.name = "d." + info.name + " of " + node.name;
        gradient.needs_input_grad.push_back(n);
        outputs.push_back(graph().add(info));
        parts_[id].push_back(outputs.back());
      }
      if (gradient.constants) {
        outputs.push_back(graph().add({.name = "d." + node.name,
                                       .rows = Rows::one,
                                       .width = static_cast<int>(ops::constant_count(op)),
                                       .fiber = {}}));
        result_.constants[i] = outputs.back();
        graph().saved.push_back(outputs.back());
      }
      graph().append("d." + node.name, std::move(gradient), std::move(inputs), std::move(outputs));
    }
  }

  // The gradient of a tensor, of all that read it.
  TensorId total(TensorId id) {
    const auto parts = parts_.find(id);
    if (parts == parts_.end()) return no_tensor;
    if (parts->second.size() == 1) return parts->second.front();
    TensorInfo info = graph().tensors[id];
    info.name = "d." + info.name;
    const TensorId sum = graph().add(info);
    graph().append(info.name, ops::Sum{}, parts->second, {sum});
    return sum;
  }

  Differentiated result_;
  std::vector<bool> dependent_;
  std::map<TensorId, std::vector<TensorId>> parts_;
};

}  // namespace

Differentiated differentiate(Graph graph) { return Differentiator(std::move(graph)).run(); }

}  // namespace bitr::graph
