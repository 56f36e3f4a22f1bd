// The network as data: tensors, and the operations that make them, in the order they run.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "graph/batch_layout.hpp"
#include "graph/ports.hpp"
#include "irreps/fiber.hpp"
#include "ops/op.hpp"

namespace bitr::graph {

enum class ElementKind : std::uint8_t { real, index };

struct TensorInfo {
  std::string name;  ///< the stage's name, e.g. "fe.g1" or "key.points"
  Rows rows = Rows::point;
  int per_row = 1;  ///< entries per row: k for tensors over edges
  int width = 1;    ///< numbers per entry
  ElementKind kind = ElementKind::real;
  irreps::Fiber fiber;  ///< how the width splits into degrees; empty for plain columns
};

/// Made, copied and destroyed in graph.cpp alone: what that takes of a variant of every operation is compiled once.
struct Node {
  Node(std::string name, ops::Op op, std::vector<TensorId> reads, std::vector<TensorId> makes);
  Node(const Node&);
  Node(Node&&) noexcept;
  Node& operator=(const Node&);
  Node& operator=(Node&&) noexcept;
  ~Node();

  std::string name;
  ops::Op op;
  std::vector<TensorId> inputs;
  std::vector<TensorId> outputs;
};

struct Graph {
  std::vector<TensorInfo> tensors;
  std::vector<Node> nodes;
  Ports<Input> inputs;
  Ports<Output> outputs;
  std::vector<TensorId> saved = {};  ///< tensors without a role that are read after a run, too

  TensorId add(TensorInfo info);
  TensorId add(std::string name, Rows rows, const irreps::Fiber& fiber, int per_row = 1);
  void append(std::string name, ops::Op op, std::vector<TensorId> reads, std::vector<TensorId> makes);
  TensorId input(Input role) const { return inputs[role]; }
  TensorId output(Output role) const { return outputs[role]; }
  TensorId add_input(Input role, TensorInfo info);
  TensorId add_output(Output role, TensorInfo info);
  /// Tensors that a run leaves readable.
  std::vector<TensorId> readable() const;
  /// no_tensor when there is none of that name.
  TensorId find(const std::string& name) const;
};

/// "" when every input of every node is a graph input or made by an earlier node, no tensor is made twice and
/// no composite op is left; else the first fault.
std::string check_executable(const Graph& graph);

}  // namespace bitr::graph
