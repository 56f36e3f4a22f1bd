// mean_direction: the first attention layer when every point starts with the same scalar.
// Its keys do not depend on the edge, so attention is uniform and the layer is a function of the mean
// direction v̄ of the point's edges:
//   degree 0 = the constant `scalars`
//   degree 1 = slopes[c] · v̄ (y, z, x), then the projected ReLU (the scalars have it already)
// Points with duplicates among their neighbours are evaluated by `general`, the whole layer on the constant
// feature.
// in  positions T[P, 3]
// in  index u32[P, k]
// out features T[P, {(0,0): m₀, (1,0): m₁}]
// error float_error(), relative to the largest entry of the output
#pragma once

#include <Eigen/Core>

#include "ops/point_attention.hpp"

namespace bitr::ops {

struct MeanDirection {
  Eigen::VectorXd scalars;  ///< m₀
  Eigen::VectorXd slopes;   ///< m₁
  PointAttention general;   ///< c₀ = 1, c₁ = 0
  double constant = 0.5;    ///< the input feature

  double float_error() const { return general.float_error(); }
};

}  // namespace bitr::ops
