#include "node_bench.hpp"

namespace bitr::bench {
namespace {

// Moves numbers, computes none.
double flops(const ops::InputFeatures&, const Job&) { return 0; }

// The fold leaves it only where the network reads more than positions.
const bool added = [] {
  OpBench bench = op_bench<ops::InputFeatures>("input_features", flops);
  bench.config.return_normals = true;
  bench.sizes.push_back({65536, 1});
  return add(bench);
}();

}  // namespace
}  // namespace bitr::bench
