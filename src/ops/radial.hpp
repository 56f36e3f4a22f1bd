// radial: the small network φ(lengths) of an equivariant kernel, one per (degree in, degree out).
//   Linear(e → 32, no bias) → LN → LeakyReLU(0.2) → Linear(32 → 32) → LN → LeakyReLU(0.2) → Linear(32 → n)
// Scale degree 1: no LN, no bias, so φ is positively homogeneous of degree 1.
// in  lengths T[E, e]
// out coefficients T[E, n]      n = c_out · c_in · freq, freq fastest
// error that of the operation that evaluates it
// source eq. 74 of the paper: how two-sided networks are tied
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <memory>

#include "irreps/fiber.hpp"

namespace bitr::ops {

constexpr int radial_width = 32;
constexpr double leaky_slope = 0.2;

struct RadialNetwork {
  int scale_degree = 0;
  double eps = 1e-8;   ///< both LayerNorms'; 0 in scale-exact mode, where no variance gives the bias
  Eigen::MatrixXd w1;  ///< 32 × e
  Eigen::VectorXd gain1, bias1;
  Eigen::MatrixXd w2;  ///< 32 × 32
  Eigen::VectorXd c2, gain2, bias2;
  Eigen::MatrixXd w3;  ///< n × 32
  Eigen::VectorXd c3;
};

/// How a two-sided network serves its pair of degrees (swap equivariance, eq. 74 of the paper).
enum class Tying {
  direct,    ///< φ(r₁, r₂)
  mirrored,  ///< φ(r₂, r₁) with the two frequencies exchanged; the network belongs to the mirrored pair
  symmetrised,  ///< ½ (φ(r₁, r₂) + φ(r₂, r₁)ᵀ)
};

/// The radial functions of one pair of degrees.
struct RadialBlock {
  irreps::Degree in, out;
  int in_channels = 0, out_channels = 0;
  Tying tying = Tying::direct;
  std::shared_ptr<const RadialNetwork> network;

  int freq1() const { return 2 * std::min(in.p, out.p) + 1; }
  int freq2() const { return 2 * std::min(in.q, out.q) + 1; }
  int freq() const { return freq1() * freq2(); }
};

}  // namespace bitr::ops
