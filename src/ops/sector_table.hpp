// sector_table: a two-input radial network, exactly, without the network.
// Along a ray ρ = (r₁, r₂) the activation pattern of its LeakyReLUs is fixed (the first layer has no bias),
// so the quadrant splits into sectors:
//   scale degree 1:  R = A_s ρ
//   scale degree 0:  (x, y) = ρ/√(q(ρ)+eps);  v = (x, y, 1)/√(Q_s(x, y, 1)+eps);  R = B_s v + c_s
// with q, Q_s the LayerNorms' variances as quadratic forms. The pattern is the eps = 0 one, so where eps
// matters (q(ρ) or Q_s below 1e4·eps, or 0) the network itself is evaluated.
// in  lengths T[E, 2]
// out coefficients T[E, size]   added to those of other tables, from `begin` on
// error that of the operation that evaluates it
#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <vector>

#include "ops/radial.hpp"

namespace bitr::ops {

struct SectorTable {
  int scale_degree = 0;
  bool swapped = false;  ///< evaluate at (r₂, r₁)
  int begin = 0;         ///< first coefficient it adds to
  int size = 0;          ///< coefficients: (freq, out_channels, in_channels)

  /// Rays between sectors, by ascending angle in (0, π/2), as (cos, sin). Sector s lies between rays s−1 and
  /// s.
  std::vector<std::array<double, 2>> rays;
  std::vector<Eigen::MatrixXd> slope;    ///< per sector: size × 2 (A_s) or size × 3 (B_s)
  std::vector<Eigen::VectorXd> offset;   ///< per sector: c_s; scale degree 0 only
  std::array<double, 3> q{};             ///< q(r₁, r₂) = q₀r₁² + q₁r₁r₂ + q₂r₂²
  std::vector<std::array<double, 6>> Q;  ///< per sector, of (x, y, 1): xx, xy, yy, x, y, 1

  std::shared_ptr<const RadialNetwork> network;  ///< for ρ where the eps matters
  Eigen::MatrixXd basis;  ///< freq' × freq: from the network's order to the coefficients'
  double scale = 1;       ///< ½ for the two halves of a symmetrised network

  std::size_t sectors() const { return rays.size() + 1; }
};

}  // namespace bitr::ops
