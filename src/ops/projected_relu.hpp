// projected_relu: the non-linearity between layers.
//   degree (0,0): LeakyReLU(0.2)
//   otherwise, per channel, with d = W x and p = ⟨x, d⟩:
//   relu(x) = x where p ≥ 0, else x − d p/|d|,  |d| clamped below by 1e-8
//   out = 0.2 x + 0.8 relu(x)
// One power of |d|, as in the official code; two if `square`, which makes out independent of the length of d.
// in  features T[rows, fiber]
// out features T[rows, fiber]
// error float_error(), relative to the largest entry of the output
#pragma once

#include "ops/linear.hpp"

namespace bitr::ops {

constexpr double plane_norm_floor = 1e-8;

/// The bound of an operation that ends with a projected ReLU. Over its squared length, a plane's normal counts
/// however short it is: small differences grow.
constexpr double relu_error(double error, bool square) { return square ? 5 * error : error; }

struct ProjectedRelu {
  irreps::Fiber fiber;
  DegreeMatrices planes;  ///< m × m per degree other than (0,0)
  bool square = false;

  double float_error() const { return relu_error(2e-5, square); }
};

}  // namespace bitr::ops
