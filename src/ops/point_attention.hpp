// point_attention: a one-sided attention layer (degrees ≤ 1) whose edges carry no weights.
// The radial networks of the extractor see one number r through a LayerNorm without a preceding bias, so they
// are constants: LN(r w) = LN(w). With φ_j the Clebsch–Gordan products of direction and neighbour feature,
//   φ⁰ = (f⁰_j ; v·f¹_j ; [v])                    n₀ = c₀ + c₁ (+ 3 with `direction`)
//   φ¹ = (v f⁰_j ; K₀f¹_j ; K₁f¹_j ; K₂f¹_j)      n₁ = c₀ + 3 c₁
//   K₀ = −1/√3,  K₁ = [v]×/√2,  K₂ = (3vvᵀ − 1)/√6
// values and keys are linear in φ, so the layer is plain attention with key = value = φ:
//   e_hj = ⟨Q_h, φ_j⟩,  Q = M·f_i
//   agg_h = Σ_j softmax_j(e_h) φ_j
//   out = O·agg + S·f_i, then the projected ReLU
// An edge of length zero (duplicate points) has no direction, and its LayerNorm sees 0 instead of r w: its φ
// is zero, and φᶻ = (f⁰_j, 1; f¹_j), zero for all other edges, takes its place with coefficients of its own.
// in  features T[P, {(0,0): c₀, (1,0): c₁}]
// in  index u32[Q, k]
// in  centres T[Q, 3]
// in  neighbours T[P, 3]
// in  coefficients T[clouds, coefficient_count()]    if `per_cloud`
//       M₀, O₀, S₀, Mᶻ₀, Oᶻ₀ of each cloud, in that order, row-major
// out features T[Q, {(0,0): m₀, (1,0): m₁}]
// error float_error(), relative to the largest entry of the output, at k ≤ 64
#pragma once

#include <Eigen/Core>

#include "ops/projected_relu.hpp"

namespace bitr::ops {

struct PointAttention {
  int c0 = 0, c1 = 0;  ///< channels in
  int m0 = 0, m1 = 0;  ///< channels out
  int heads = 1;
  bool uniform = false;    ///< no queries (zero centre features): plain mean over the neighbours, heads = 1
  bool direction = false;  ///< φ⁰ ends with v itself
  bool per_cloud = false;  ///< degree-0 coefficients come from a tensor
  /// (heads·n₀) × (c₀+1), last column constant; (heads·n₁) × c₁, empty without keys there
  Eigen::MatrixXd M0, M1;
  Eigen::MatrixXd O0, O1;    ///< m₀ × (heads·n₀); m₁ × (heads·n₁)
  Eigen::MatrixXd S0, S1;    ///< m₀ × (c₀+1), last column constant; m₁ × c₁
  Eigen::MatrixXd Mz0, Mz1;  ///< (heads·(c₀+1)) × (c₀+1); (heads·c₁) × c₁, empty without keys there
  Eigen::MatrixXd Oz0, Oz1;  ///< m₀ × (heads·(c₀+1)); m₁ × (heads·c₁)
  bool relu = false;
  Eigen::MatrixXd plane;     ///< m₁ × m₁ of the projected ReLU
  bool relu_square = false;  ///< ops::ProjectedRelu::square

  int n0() const { return c0 + c1 + (direction ? 3 : 0); }
  int n1() const { return c0 + 3 * c1; }
  int coefficient_count() const {
    const int from = c0 + 1;
    return heads * n0() * from + m0 * heads * n0() + m0 * from + heads * from * from + m0 * heads * from;
  }
  /// Logits of trained models reach far into the exponent: 2.8e-5 was measured without a ReLU.
  double float_error() const { return relu_error(4e-5, relu_square); }
};

}  // namespace bitr::ops
