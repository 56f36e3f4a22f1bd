// loss: what training minimises is the mean over pairs of the sum of these terms.
//   official  mean((R_gt Rᵀ − 1)²),  mean((t_gt − t)²), through the projection
//   direct    2.7 · mean((r̂/max(|r̂|, 1e-5) − R_gt/√3)²),  √(|p₂ − R_gt p₁ − t_gt|² + 1e-4), unprojected
//   robust    0.5 · √(|r̂/max(|r̂|, 1e-5) − R_gt/√3|² + 1e-3), and direct's translation
//   all       −0.1 · Σ over both clouds of mean_{c,c'} min(|x_c − x_c'|₁, 0.1), over all pairs of key points
// R and t map the source onto the reference; r̂[reference, source] is the transpose of the head's r;
// p₁ = m₁ + a, p₂ = m₂ + b are its pieces.
// A shape that a turn about an axis maps to itself has many true poses: R_gt and t_gt are then the one
// nearest to the estimate, R_gt S and t_gt + R_gt (c − S c), S the turn with the largest ⟨R or r̂, R_gt S⟩.
// Its gradient is that of the mean over pairs of their sum, so that it is given none. |r̂| counts as a
// constant where it is floored only, S everywhere.
// in  pose T[pairs, 16]         `official`
//       others: pieces T[pairs, 21]
// in  truth T[pairs, 20]
//       R_gt (9, row-major), t_gt (3); in the source's frame the unit axis (3) and a point c on it (3);
//       the smallest turn in radians (1), of which S is a multiple: 0 for any angle, 2π for none; 0 (1)
// in  key points T[clouds·K, 3]
// out terms T[pairs, 3]
//       rotation, translation, spread
// error float_error(), relative to the largest entry of the output
// source §5 of the paper: `official`
#pragma once

#include <array>
#include <cstdint>
#include <numbers>

namespace bitr::ops {

enum class LossKind : std::uint8_t { official, direct, robust };

constexpr int truth_width = 20;
constexpr int pose_numbers = 12;  ///< the first numbers of the truth: R_gt, t_gt
/// The other numbers of a shape without symmetry.
constexpr std::array<double, truth_width - pose_numbers> no_symmetry = {
    0, 0, 1, 0, 0, 0, 2 * std::numbers::pi, 0};
constexpr int loss_terms = 3;
constexpr double spread_weight = 0.1, spread_reach = 0.1;
constexpr double direct_rotation_weight = 2.7, direct_softening = 1e-4;
constexpr double robust_rotation_weight = 0.5, robust_softening = 1e-3;

struct Loss {
  LossKind kind = LossKind::direct;

  double float_error() const { return 1e-5; }
  static constexpr double gradient_error = 1e-5;  ///< Gradient::float_error(), on Vulkan
};

}  // namespace bitr::ops
