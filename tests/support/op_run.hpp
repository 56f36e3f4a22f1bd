// Operations run alone, with guards behind every tensor.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "cpu/executor.hpp"

namespace bitr::test {

/// One tensor's shape and, for inputs, values.
struct OpTensor {
  graph::Rows rows = graph::Rows::point;
  int per_row = 1;
  int width = 1;
  bool index = false;
  std::vector<double> values;          ///< a real tensor's
  std::vector<std::uint32_t> indices;  ///< an index tensor's

  static OpTensor like(const graph::TensorInfo& info) {
    return {info.rows, info.per_row, info.width, info.kind == graph::ElementKind::index, {}, {}};
  }
};

/// A tensor of an executor that has run.
inline OpTensor read(const graph::Executor& executor, graph::TensorId id) {
  OpTensor tensor = OpTensor::like(executor.graph().tensors.at(id));
  if (tensor.index)
    tensor.indices = executor.read<std::uint32_t>(id);
  else
    tensor.values = executor.read<double>(id);
  return tensor;
}

/// As float holds it, so that either type reads the same numbers. Through memory, where no register is wider.
inline OpTensor rounded(OpTensor tensor) {
  const std::vector<float> single(tensor.values.begin(), tensor.values.end());
  tensor.values.assign(single.begin(), single.end());
  return tensor;
}

/// `op` alone: its inputs, then its outputs.
inline graph::Graph graph_of(const ops::Op& op, const std::vector<OpTensor>& inputs,
                             const std::vector<OpTensor>& outputs) {
  graph::Graph graph;
  const auto add = [&](const std::vector<OpTensor>& tensors) {
    std::vector<graph::TensorId> ids;
    for (const OpTensor& tensor : tensors)
      ids.push_back(graph.add({.name = "t" + std::to_string(graph.tensors.size()),
                               .rows = tensor.rows,
                               .per_row = tensor.per_row,
                               .width = tensor.width,
                               .kind = tensor.index ? graph::ElementKind::index : graph::ElementKind::real,
                               .fiber = {}}));
    return ids;
  };
  std::vector<graph::TensorId> in = add(inputs), out = add(outputs);
  graph.append("op", op, std::move(in), std::move(out));
  return graph;
}

/// Bytes behind every tensor that no kernel may touch.
constexpr std::size_t guard_bytes = 256;

/// Runs an executor of graph_of() that has guards; expects those untouched; returns the outputs.
/// A Vulkan executor's node has memory of its own behind those.
inline std::vector<OpTensor> run_node(graph::Executor& executor, const graph::BatchLayout& layout,
                                      const std::vector<OpTensor>& inputs, std::size_t outputs) {
  const graph::Node& node = executor.graph().nodes.front();
  executor.prepare(layout);
  for (std::size_t i = 0; i < inputs.size(); ++i)
    if (inputs[i].index)
      executor.write(node.inputs[i], inputs[i].indices);
    else
      executor.write(node.inputs[i], inputs[i].values);
  executor.run();
  std::vector<OpTensor> results;
  for (std::size_t o = 0; o < outputs; ++o) results.push_back(read(executor, node.outputs[o]));
  EXPECT_TRUE(executor.guards_hold()) << "written outside an output";
  return results;
}

/// Runs `op` on the CPU in T; expects guards and inputs untouched; returns the outputs. What a kernel leaves
/// unwritten is NaN, or the largest index.
template <class T>
std::vector<OpTensor> run_op(const ops::Op& op, const graph::BatchLayout& layout,
                             const std::vector<OpTensor>& inputs, const std::vector<OpTensor>& outputs,
                             ThreadPool& pool) {
  cpu::Executor<T> executor(graph_of(op, inputs, outputs), pool, {.guard_bytes = guard_bytes});
  std::vector<OpTensor> results = run_node(executor, layout, inputs, outputs.size());
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    const OpTensor after = read(executor, executor.graph().nodes.front().inputs[i]);
    const std::vector<T> before(inputs[i].values.begin(), inputs[i].values.end());
    // What is not a number stays what it is.
    const auto same = [](T a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); };
    EXPECT_TRUE(after.indices == inputs[i].indices &&
                std::equal(before.begin(), before.end(), after.values.begin(), after.values.end(), same))
        << "an input was written to";
  }
  return results;
}

}  // namespace bitr::test
