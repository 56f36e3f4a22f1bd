#include "node_bench.hpp"

namespace bitr::bench {
namespace {

// Per edge: direction 13, sum 3. Per point: mean 3, slopes 3m₁, projected ReLU.
double flops(const ops::MeanDirection& op, const Job& job) {
  const int m1 = static_cast<int>(op.slopes.size());
  const double point = 3 + 3 * m1 + (op.general.relu ? projected_relu_flops(m1, 3) : 0);
  return job.rows(job.out(0)) * (16.0 * job.in(1).per_row + point);
}

const bool added = [] {
  OpBench bench = op_bench<ops::MeanDirection>("mean_direction", flops);
  bench.sizes.push_back({65536, 1});
  return add(bench);
}();

}  // namespace
}  // namespace bitr::bench
