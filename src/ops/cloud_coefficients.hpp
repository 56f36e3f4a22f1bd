// cloud_coefficients: a layer's coefficients, cloud by cloud, in place of extended features.
// What extend_features appends is constant over a cloud, so it moves from the points' features into the
// coefficients of the layer that reads them: constants s₀ of degree 0 become biases, vectors s₁ of degree 1
// become coefficients of the edge direction, v·s₁.
// in  means T[clouds, {(0,0): c₀, (1,0): c₁}]
// in  globals T[clouds, global_channels]
// out coefficients T[clouds, layer.coefficient_count()]
//       M₀, O₀, S₀, Mᶻ₀, Oᶻ₀ of `layer` (ops/point_attention.hpp)
// error float_error(), relative to the largest entry of the output
#pragma once

#include "ops/point_attention.hpp"

namespace bitr::ops {

struct CloudCoefficients {
  PointAttention full;   ///< the layer on the extended features
  PointAttention layer;  ///< the layer on the points' own features, with per-cloud coefficients

  double float_error() const { return 1e-6; }
  static constexpr double gradient_error = 1e-5;  ///< Gradient::float_error(), on Vulkan
};

}  // namespace bitr::ops
