// The network as data: tensors, and the operations that make them, in the order they run.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "graph/batch_layout.hpp"
#include "irreps/fiber.hpp"
#include "ops/op.hpp"

namespace bitr::graph {

using TensorId = int;
constexpr TensorId no_tensor = -1;

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
  // Filled by the caller before a run. Normals, colours and offsets (from the cloud's centroid,
  // over the root mean square of their lengths) only exist if the model reads them.
  TensorId positions = no_tensor, normals = no_tensor, colors = no_tensor, offsets = no_tensor;
  // Read by the caller after it.
  TensorId key_points = no_tensor, pose = no_tensor;
  TensorId result = no_tensor;  ///< what a graph that is not the network's makes
  // In a training graph: the true poses (ops/loss.hpp), filled by the caller; the loss.
  TensorId truth = no_tensor, loss = no_tensor;
  std::vector<TensorId> saved = {};  ///< others that are read after a run

  TensorId add(TensorInfo info);
  TensorId add(std::string name, Rows rows, const irreps::Fiber& fiber, int per_row = 1);
  void append(std::string name, ops::Op op, std::vector<TensorId> reads, std::vector<TensorId> makes);
  /// Those that a run leaves readable.
  std::vector<TensorId> outputs() const;
  /// no_tensor when there is none of that name.
  TensorId find(const std::string& name) const;
};

/// "" when every input of every node is a graph input or made by an earlier node, no tensor is made twice and
/// no composite op is left; else the first fault.
std::string check_executable(const Graph& graph);

}  // namespace bitr::graph
