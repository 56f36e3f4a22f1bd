#include "node_bench.hpp"

namespace bitr::bench {
namespace {

// Per edge: direction 13; v·f¹ 5c₁; with vectors out v f⁰ 3c₀ and K₀f¹, K₁f¹, K₂f¹ (3 + 12 + 9)c₁.
// Per edge and head: φ into the sum 2(n₀ + 3n₁), with queries as much again for the logit and 3 for the
// softmax. Per centre: queries, outputs and the own feature by their matrices, then the projected ReLU.
double flops(const ops::PointAttention& op, const Job& job) {
  const bool vectors = op.m1 > 0, vector_keys = op.M1.size() > 0;
  const double n0 = op.n0(), n1 = vectors ? op.n1() : 0, from = op.c0 + 1;
  double edge = 13 + 5 * op.c1 + (vectors ? 3 * op.c0 + 24 * op.c1 : 0);
  double centre = 2 * op.m0 * op.heads * n0 + 6 * op.m1 * op.heads * n1;
  if (op.uniform) {
    edge += n0 + 3 * n1;
  } else {
    edge += op.heads * (2 * (n0 + 3 * n1) + 2 * (n0 + (vector_keys ? 3 * n1 : 0)) + 3);
    centre +=
        2 * op.heads * n0 * from + 2 * op.m0 * from + 6 * static_cast<double>(op.M1.size() + op.S1.size());
  }
  if (op.relu) centre += op.m0 + projected_relu_flops(op.m1, 3);
  return job.rows(job.out(0)) * (job.in(1).per_row * edge + centre);
}

const bool added = [] {
  OpBench bench = op_bench<ops::PointAttention>("point_attention", flops);
  bench.sizes.push_back({65536, 1});
  return add(bench);
}();

}  // namespace
}  // namespace bitr::bench
