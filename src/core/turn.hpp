// Turns about an axis, for objects that look the same after them.
#pragma once

#include <array>
#include <bitr/cloud.hpp>
#include <cmath>

namespace bitr {

/// By `angle` about the unit axis n, row by row: Rodrigues' formula.
inline std::array<double, 9> turn_about(const Vec3d& n, double angle) {
  const auto [x, y, z] = n;
  const double c = std::cos(angle), s = std::sin(angle), d = 1 - c;
  return {c + d * x * x,     d * x * y - s * z, d * x * z + s * y,  //
          d * x * y + s * z, c + d * y * y,     d * y * z - s * x,  //
          d * x * z - s * y, d * y * z + s * x, c + d * z * z};
}

struct Turn {
  double angle = 0;
  double margin = 0;  ///< how much ⟨A, S(θ)⟩ varies with θ, half of it; 0: no turn is better than another
};

/// The turn S(θ) about the unit `axis` for which ⟨A, S(θ)⟩ is largest: for a rotation A, the turn nearest to
/// it. A: 3 × 3, row by row, of any length. ⟨A, S(θ)⟩ = cos θ (tr A − nᵀAn) + sin θ n · (A − Aᵀ)^∨ + nᵀAn.
inline Turn best_turn(const std::array<double, 9>& A, const Vec3d& axis) {
  const auto& n = axis;
  double along = 0;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) along += n[i] * A[3 * i + j] * n[j];
  const double sine = n[0] * (A[7] - A[5]) + n[1] * (A[2] - A[6]) + n[2] * (A[3] - A[1]);
  const double cosine = A[0] + A[4] + A[8] - along;
  return {std::atan2(sine, cosine), std::hypot(sine, cosine)};
}

/// The angle of the best of the turns that there are, multiples of `step`; 0: all. ⟨A, S(θ)⟩ falls off evenly
/// on both sides of its maximum.
inline double nearest_turn(const std::array<double, 9>& A, const Vec3d& axis, double step) {
  const double angle = best_turn(A, axis).angle;
  return step > 0 ? step * std::round(angle / step) : angle;
}

}  // namespace bitr
