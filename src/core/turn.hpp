// Turns about an axis, for objects that look the same after them.
#pragma once

#include <array>
#include <bitr/cloud.hpp>
#include <cmath>

namespace bitr {

/// The angle θ of the turn S(θ) about the unit `axis` for which ⟨A, S(θ)⟩ is largest: for a rotation A, the
/// turn nearest to it. A: 3 × 3, row by row, of any length. `step`: the turns there are, multiples of it; 0:
/// all. ⟨A, S(θ)⟩ = cos θ (tr A − nᵀAn) + sin θ n · (A − Aᵀ)^∨ + nᵀAn falls off evenly on both sides of its
/// maximum.
inline double nearest_turn(const std::array<double, 9>& A, const Vec3d& axis, double step) {
  const auto& n = axis;
  double along = 0;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) along += n[i] * A[3 * i + j] * n[j];
  const double sine = n[0] * (A[7] - A[5]) + n[1] * (A[2] - A[6]) + n[2] * (A[3] - A[1]);
  const double angle = std::atan2(sine, A[0] + A[4] + A[8] - along);
  return step > 0 ? step * std::round(angle / step) : angle;
}

}  // namespace bitr
