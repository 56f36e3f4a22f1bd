// The numbers of an operation that training changes, each a span of the operation's own memory, in a fixed
// order. An operation of the same shape that holds a gradient instead of values has the same spans.
#pragma once

#include <set>
#include <span>
#include <type_traits>
#include <vector>

#include "ops/op.hpp"

namespace bitr::ops {

using ConstantSpans = std::vector<std::span<double>>;

namespace detail {

template <class Matrix>
void add(ConstantSpans& spans, Matrix& matrix) {
  if (matrix.size() > 0) spans.emplace_back(matrix.data(), static_cast<std::size_t>(matrix.size()));
}
inline void add(ConstantSpans& spans, DegreeMatrices& matrices) {
  for (auto& [d, matrix] : matrices) add(spans, matrix);
}
inline void add(ConstantSpans& spans, RadialNetwork& net) {
  add(spans, net.w1), add(spans, net.gain1), add(spans, net.bias1);
  add(spans, net.w2), add(spans, net.c2), add(spans, net.gain2), add(spans, net.bias2);
  add(spans, net.w3), add(spans, net.c3);
}
// slope, offset and Q sector by sector, then q. Rays between sectors have no gradient: the maps on both sides
// agree there.
inline void add(ConstantSpans& spans, SectorTable& table) {
  for (std::size_t s = 0; s < table.sectors(); ++s) {
    add(spans, table.slope[s]);
    if (table.scale_degree == 1) continue;
    add(spans, table.offset[s]);
    add(spans, table.Q[s]);
  }
  if (table.scale_degree == 0) add(spans, table.q);
}

}  // namespace detail

/// Mutable networks of a convolution, each once, in the order of the blocks that use them.
inline std::vector<RadialNetwork*> networks_of(Convolve& op) {
  std::vector<RadialNetwork*> networks;
  std::set<const RadialNetwork*> seen;
  for (RadialBlock& block : op.blocks)
    if (seen.insert(block.network.get()).second)
      networks.push_back(const_cast<RadialNetwork*>(block.network.get()));
  return networks;
}

template <class Operation>
ConstantSpans constants(Operation&) {
  return {};
}
inline ConstantSpans constants(Linear& op) {
  ConstantSpans spans;
  detail::add(spans, op.weights);
  return spans;
}
inline ConstantSpans constants(Convolve& op) {
  ConstantSpans spans;
  for (RadialNetwork* network : networks_of(op)) detail::add(spans, *network);
  return spans;
}
inline ConstantSpans constants(RadialNetwork& network) {
  ConstantSpans spans;
  detail::add(spans, network);
  return spans;
}
inline ConstantSpans constants(ProjectedRelu& op) {
  ConstantSpans spans;
  detail::add(spans, op.planes);
  return spans;
}
inline ConstantSpans constants(Head& op) {
  ConstantSpans spans;
  detail::add(spans, op.norm_weight), detail::add(spans, op.norm_bias), detail::add(spans, op.mean_scale);
  detail::add(spans, op.logit_weight), detail::add(spans, op.logit_bias);
  detail::add(spans, op.vector_mix), detail::add(spans, op.matrix_mix);
  return spans;
}
inline ConstantSpans constants(PointAttention& op) {
  ConstantSpans spans;
  for (Eigen::MatrixXd* matrix :
       {&op.M0, &op.M1, &op.O0, &op.O1, &op.S0, &op.S1, &op.Mz0, &op.Mz1, &op.Oz0, &op.Oz1, &op.plane})
    detail::add(spans, *matrix);
  return spans;
}
/// Those of `general`, from which `scalars` and `slopes` are made.
inline ConstantSpans constants(MeanDirection& op) { return constants(op.general); }
/// Those of the layer on the extended features.
inline ConstantSpans constants(CloudCoefficients& op) { return constants(op.full); }
inline ConstantSpans constants(PairAttention& op) {
  ConstantSpans spans;
  for (SectorTable& table : op.tables) detail::add(spans, table);
  detail::add(spans, op.query), detail::add(spans, op.project), detail::add(spans, op.self);
  detail::add(spans, op.planes);
  return spans;
}

template <class Operation>
std::size_t constant_count(const Operation& op) {
  std::size_t count = 0;
  for (const auto& span : constants(const_cast<Operation&>(op))) count += span.size();
  return count;
}

/// Adds one operation's constants to another's of the same shape.
template <class Operation>
void add_constants(Operation& sum, Operation& part) {
  const auto to = constants(sum), from = constants(part);
  for (std::size_t s = 0; s < to.size(); ++s)
    for (std::size_t i = 0; i < to[s].size(); ++i) to[s][i] += from[s][i];
}

/// The same shapes, all zero: a place for the gradient of the constants.
template <class Operation>
Operation zeros_like(const Operation& op) {
  Operation zeros = op;
  if constexpr (std::is_same_v<Operation, Convolve>) {
    std::map<const RadialNetwork*, std::shared_ptr<const RadialNetwork>> copies;
    for (RadialBlock& block : zeros.blocks) {
      auto& copy = copies[block.network.get()];
      if (!copy) copy = std::make_shared<RadialNetwork>(*block.network);
      block.network = copy;
    }
  }
  for (const auto& span : constants(zeros)) std::fill(span.begin(), span.end(), 0.0);
  return zeros;
}

}  // namespace bitr::ops
