// pose: projects r̂ onto SO(3) and assembles the translation, evaluated in double precision.
//   r̂[reference, source] = rᵀ / max(|r|, 1e-5)
//   R = U Vᵀ of its SVD, last row of Vᵀ negated if det(U Vᵀ) ≤ 0
//   t = m₂ + b − R m₁ − R a
// in  pieces T[pairs, 21]       as ops/head.hpp lays them out
// out pose T[pairs, 16]
//       R (9, row-major), t (3), singular values of r̂ (3, descending), det(U Vᵀ) before the flip (1)
// error float_error(), relative to the largest entry of the output, where (s₂ ± s₃)/s₁ ≥ 0.1; a rotation less
//       well determined by r̂ differs in inverse proportion
#pragma once

namespace bitr::ops {

constexpr double matrix_norm_floor = 1e-5;
constexpr int pose_width = 16;

struct ProjectPose {
  static constexpr double well_determined = 0.1;  ///< (s₂ ± s₃)/s₁ of an r̂ from which on float_error() holds
  static constexpr double singular_value_error = 1e-6;  ///< relative to the largest of them

  double float_error() const { return 1e-4; }
  static constexpr double gradient_error = 1e-3;  ///< Gradient::float_error(), on Vulkan
};

}  // namespace bitr::ops
