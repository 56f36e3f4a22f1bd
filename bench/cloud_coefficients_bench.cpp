#include "node_bench.hpp"

namespace bitr::bench {
namespace {

// Per cloud, with `extra` constants appended to c₀ scalars and c₁ vectors to the own c₁: every matrix on the
// extended scalars condenses its extra columns into one, 2·extra a row; three paths gather c₁ each, 6·c₁ a
// column or row; constant paths move into biases, 2·extra a column or row.
double flops(const ops::CloudCoefficients& op, const Job& job) {
  const ops::PointAttention &full = op.full, &layer = op.layer;
  const double extra = full.c0 - layer.c0, from = layer.c0 + 1;
  const double head = 2 * extra * (full.n0() + full.c0 + 1) + 6.0 * layer.c1 * (from + layer.m0) +
                      4 * extra * from + 6 * extra * layer.m0;
  return job.rows(job.out(0)) * (2 * extra * layer.m0 + layer.heads * head);
}

const bool added = add(op_bench<ops::CloudCoefficients>("cloud_coefficients", flops));

}  // namespace
}  // namespace bitr::bench
