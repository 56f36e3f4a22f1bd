#include "node_bench.hpp"

namespace bitr::bench {
namespace {

// Into the frames, or out of them: 15 per vector and side.
double turn_flops(const irreps::Fiber& fiber) {
  double flops = 0;
  for (const auto& [d, m] : fiber) flops += 15.0 * m * (d.p * (2 * d.q + 1) + d.q * (2 * d.p + 1));
  return flops;
}

double mixing_flops(const ops::DegreeMatrices& matrices) {
  double flops = 0;
  for (const auto& [d, matrix] : matrices) flops += 2.0 * static_cast<double>(matrix.size()) * d.dim();
  return flops;
}

// Per edge: frames 60; per coefficient 2·2 (scale degree 1) or 2·3; features into the frames and messages
// back; per block and pair of channels 2 for each term that the frames leave, of 5 between vectors and 1
// else, on both sides; logits and sums 2 a number, softmax 3 a head. Per node: query, output, own feature,
// projected ReLU.
double flops(const ops::PairAttention& op, const Job& job) {
  const auto terms = [](int in, int out) { return in == 1 && out == 1 ? 5 : 1; };
  double edge = 60 + turn_flops(op.fiber_in) + turn_flops(op.value_fiber) + turn_flops(op.key_fiber) +
                2 * op.key_fiber.size() + 2 * op.value_fiber.size() + 3 * op.heads;
  for (const ops::SectorTable& table : op.tables) edge += (table.scale_degree == 0 ? 6 : 4) * table.size;
  for (const ops::PairBlock& b : op.blocks)
    edge += 2.0 * b.in_channels * b.out_channels * terms(b.in.p, b.out.p) * terms(b.in.q, b.out.q);
  double node = mixing_flops(op.query) + mixing_flops(op.project) + mixing_flops(op.self);
  if (op.relu)
    for (const auto& [d, m] : op.fiber_out) node += d.dim() == 1 ? m : projected_relu_flops(m, d.dim());
  return job.rows(job.out(0)) * (job.in(1).per_row * edge + node);
}

const bool added = add(op_bench<ops::PairAttention>("pair_attention", flops));

}  // namespace
}  // namespace bitr::bench
