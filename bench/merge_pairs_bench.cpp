#include "node_bench.hpp"

namespace bitr::bench {
namespace {

// Per node and channel: a sum and an outer product of vectors, 10.
double flops(const ops::MergePairs& op, const Job& job) { return job.rows(job.out(0)) * 10.0 * op.channels; }

const bool added = add(op_bench<ops::MergePairs>("merge_pairs", flops));

}  // namespace
}  // namespace bitr::bench
