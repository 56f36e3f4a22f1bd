// head: from the two-sided network's features to the pieces of the pose, evaluated in double precision.
//   s = Linear(GraphNorm(degree (0,0)))
//   w = softmax of s over the pair's key points, per column
//   (m₁, m₂) = Σ w₂ (x, y)
//   a = Σ w₁ F₍₁,₀₎,  b = Σ w₁ F₍₀,₁₎,  r = Σ w₀ F₍₁,₁₎
// a, b and r are each reduced to one channel and turned back from (y, z, x) to (x, y, z).
// in  positions T[pairs·K, 6]
// in  features T[pairs·K, fiber]
// out normed T[pairs·K, c₀]
// out logits T[pairs·K, 3]
// out weights T[pairs·K, 3]
// out pieces T[pairs, 21]
//       r (9, row: source, column: reference), m₁ m₂ (6), a (3), b (3)
// error float_error(), relative to the largest entry of the output
#pragma once

#include <Eigen/Core>

#include "irreps/fiber.hpp"

namespace bitr::ops {

constexpr int piece_count = 21;

struct Head {
  irreps::Fiber fiber;
  double eps = 1e-6;  ///< GraphNorm's; 0 in scale-exact mode
  Eigen::VectorXd norm_weight, norm_bias, mean_scale;
  Eigen::MatrixXd logit_weight;  ///< 3 × c₀
  Eigen::VectorXd logit_bias;
  Eigen::RowVectorXd vector_mix, matrix_mix;  ///< 1 × channels of (1,0)/(0,1) and of (1,1)

  double float_error() const { return 2e-5; }
  static constexpr double gradient_error = 1e-5;  ///< Gradient::float_error(), on Vulkan
};

}  // namespace bitr::ops
