// Evaluates radial networks as defined.
#pragma once

#include "cpu/kernel.hpp"

namespace bitr::cpu {

/// A network's parameters in T.
template <class T>
class Radial {
 public:
  using Matrix = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic>;

  explicit Radial(const ops::RadialNetwork& network);
  /// lengths: inputs × E (a column per edge); returns outputs × E.
  Matrix evaluate(const Matrix& lengths) const;

 private:
  using Vector = Eigen::Matrix<T, Eigen::Dynamic, 1>;
  static void activate(Matrix& hidden, const Vector& gain, const Vector& bias, T eps);

  int scale_degree_;
  T eps_;
  Matrix w1_, w2_, w3_;
  Vector gain1_, bias1_, c2_, gain2_, bias2_, c3_;
};

/// The radial functions of one pair of degrees, tying included: rows (c_out, c_in, freq), freq fastest; a
/// column per edge. lengths: sides × E.
template <class T>
typename Radial<T>::Matrix evaluate_block(const ops::RadialBlock& block, const Radial<T>& network,
                                          const typename Radial<T>::Matrix& lengths);

}  // namespace bitr::cpu
