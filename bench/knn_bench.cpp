#include "node_bench.hpp"

namespace bitr::bench {
namespace {

// Brute force: per query and reference of its segment, `dim` differences and squares and their sum. A search
// that looks at fewer references has the rate of the brute force that it replaces.
double flops(const ops::Knn& op, const Job& job) {
  const auto queries = job.out(0).rows, references = job.in(1).rows;
  const auto count = [&](graph::Rows rows, std::uint32_t s) {
    return static_cast<double>(job.layout.begin(rows, s + 1) - job.layout.begin(rows, s));
  };
  double meetings = 0;
  for (std::uint32_t s = 0; s < job.layout.segments(queries); ++s)
    meetings += count(queries, s) * count(references, s);
  return meetings * (3 * op.dim - 1);
}

const bool added = [] {
  OpBench bench = op_bench<ops::Knn>("knn", flops);
  bench.sizes = {{256, 1},   {1024, 1},  {1024, 16},  {4096, 1},
                 {16384, 1}, {65536, 1}, {262144, 1}, {1000000, 1}};
  bench.wanted = [](const std::string& node, Size size) {
    return node == "graph.index" || size.points == 1024;  // the others search among few or for few
  };
  return add(bench);
}();

}  // namespace
}  // namespace bitr::bench
