// Degrees: how a feature turns with the clouds.
#pragma once

#include <compare>
#include <string>

namespace bitr {

/// A feature of (2p+1)(2q+1) numbers, on which rotations (R₁, R₂) act as D^p(R₁) ⊗ D^q(R₂), p's index slow. R₁
/// belongs to the source's side, R₂ to the reference's; {l} is an ordinary feature of degree l under one rotation.
/// The basis of a degree is that of the real spherical harmonics, m = −l … l; degree 1 is a vector in the order
/// (y, z, x).
struct Degree {
  int p = 0;
  int q = 0;

  auto operator<=>(const Degree&) const = default;
  int dim() const { return (2 * p + 1) * (2 * q + 1); }
  Degree swapped() const { return {q, p}; }
  bool symmetric() const { return p == q; }
  /// "(p, q)", as in the official state dict's names.
  std::string str() const { return "(" + std::to_string(p) + ", " + std::to_string(q) + ")"; }
};

}  // namespace bitr
