#include "node_bench.hpp"

namespace bitr::bench {
namespace {

// Per pair: an SVD of 3×3 in double precision, about 500 (it iterates), and products of 3×3. Latency, not
// work.
double flops(const ops::ProjectPose&, const Job& job) { return job.rows(job.out(0)) * 600; }

const bool added = add(op_bench<ops::ProjectPose>("pose", flops));

}  // namespace
}  // namespace bitr::bench
