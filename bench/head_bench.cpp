#include "node_bench.hpp"

namespace bitr::bench {
namespace {

// Per key point: GraphNorm 7 a scalar; three logits 2 a scalar each; three softmaxes 4 each; positions and
// every other number into weighted sums, 2 each. In double precision; what follows the sums is small.
double flops(const ops::Head& op, const Job& job) {
  const int scalars = op.fiber.channels({0, 0});
  return job.rows(job.in(1)) * (13.0 * scalars + 12 + 12 + 2 * (op.fiber.size() - scalars));
}

const bool added = add(op_bench<ops::Head>("head", flops));

}  // namespace
}  // namespace bitr::bench
