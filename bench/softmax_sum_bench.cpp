#include "node_bench.hpp"

namespace bitr::bench {
namespace {

// Per point and channel: maximum, difference, exponential and total, 4; per summed number 2.
double flops(const ops::SoftmaxSum& op, const Job& job) {
  double point = 4;
  for (std::size_t i = 0; i < op.skip.size(); ++i) point += 2 * job.out(i).width;
  return job.rows(job.in(0)) * op.channels * point;
}

const bool added = [] {
  OpBench bench = op_bench<ops::SoftmaxSum>("softmax_sum", flops);
  bench.sizes.push_back({65536, 1});
  return add(bench);
}();

}  // namespace
}  // namespace bitr::bench
