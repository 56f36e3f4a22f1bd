// Operations timed alone: nodes of the network's folded graph, on the tensors that they meet there.
#pragma once

#include <bitr/device.hpp>
#include <bitr/model.hpp>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "bench.hpp"
#include "graph/graph.hpp"

namespace bitr::bench {

/// A node and a batch, to count the node's work by.
struct Job {
  const graph::Graph& graph;
  const graph::Node& node;
  const graph::BatchLayout& layout;

  const graph::TensorInfo& in(std::size_t i) const { return graph.tensors[node.inputs[i]]; }
  const graph::TensorInfo& out(std::size_t i) const { return graph.tensors[node.outputs[i]]; }
  double rows(const graph::TensorInfo& info) const { return static_cast<double>(layout.rows(info.rows)); }
  /// Inputs read once, as far as they are read, and outputs written once.
  double bytes() const;
};

struct OpBench {
  const char* name;
  std::size_t op;                           ///< index in ops::Op
  std::function<double(const Job&)> flops;  ///< operations of one pass
  std::vector<Size> sizes = {{1024, 1}, {1024, 16}};
  ModelConfig config = {};
  /// Whether to time a node at a size; all of them unless given.
  std::function<bool(const std::string& node, Size size)> wanted = {};
};

/// Every file of an operation calls this once, before main(). `flops`: double(const Op&, const Job&).
bool add(OpBench bench);
template <class Op, class Flops>
OpBench op_bench(const char* name, Flops flops) {
  return {name, ops::Op(std::in_place_type<Op>).index(),
          [flops](const Job& job) { return flops(std::get<Op>(job.node.op), job); }};
}

/// Floating-point operations and bytes of all nodes; 0 for those of no bench.
struct Estimate {
  double flops = 0, bytes = 0;
};
Estimate estimate_of(const graph::Graph& graph, const graph::BatchLayout& layout);

/// Per channel: its plane 2·m·dim, two dot products 4·dim, root and quotient 2, blending 4·dim.
constexpr double projected_relu_flops(int m, int dim) { return m * (2.0 * m * dim + 8.0 * dim + 2.0); }

}  // namespace bitr::bench
