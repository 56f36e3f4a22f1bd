// cg_product: Clebsch–Gordan products of features, channel by channel, row by row or along edges.
//   out[e, c, m] = Σ_ij Q[(i, j), m] a[e, c, i] b[e, c, j]
//   Q = Q₁ ⊗ Q₂ of the two sides
// in  a T[P, C·dim(a)]
// in  b T[E, C·dim(b)]
//       one channel, T[E, dim(b)], if `shared`
// in  index u32[Q, k]       with it E = Q·k, and edge e takes the row index[e] of a; without, E = P
// out products T[E, C·dim(out)]
// error float_error(), relative to the largest Σ_ij |Q a b|
#pragma once

#include "irreps/fiber.hpp"

namespace bitr::ops {

struct CgProduct {
  irreps::Degree a, b, out;
  int channels = 1;
  bool shared = false;  ///< all channels of a meet the one channel of b

  double float_error() const { return 1e-6; }
};

}  // namespace bitr::ops
