// convolve: messages of an equivariant convolution, one per edge, as defined.
//   m[e, o] = Σ_i Σ_J φ_J(lengths_e) K_J(directions_e) f[neighbour(e), i]
// in  features T[P, fiber_in]
// in  index u32[Q, k]
// in  lengths T[Q, k, sides]
// in  directions T[Q, k, 3·sides]
// out messages T[Q, k, fiber_out]
// error float_error(), relative to the largest entry of the output
#pragma once

#include <vector>

#include "ops/radial.hpp"

namespace bitr::ops {

struct Convolve {
  int sides = 1;
  irreps::Fiber fiber_in, fiber_out;
  std::vector<RadialBlock> blocks;  ///< every (in, out), both sorted, in slow

  double float_error() const { return 2e-5; }
};

}  // namespace bitr::ops
