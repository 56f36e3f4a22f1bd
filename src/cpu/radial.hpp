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
  /// From the gradient of the outputs: that of the lengths. That of the parameters is added to `parameters`,
  /// of the network's shape.
  Matrix gradient(const Matrix& lengths, const Matrix& d_out, ops::RadialNetwork& parameters) const;

 private:
  using Vector = Eigen::Matrix<T, Eigen::Dynamic, 1>;
  static void activate(Matrix& hidden, const Vector& gain, const Vector& bias, T eps);
  /// hidden: what activate() read; d: the gradient of what it made, becomes that of what it read.
  static void activate_gradient(const Matrix& hidden, const Vector& gain, const Vector& bias, T eps,
                                Matrix& d, Eigen::VectorXd& d_gain, Eigen::VectorXd& d_bias);

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

/// From the gradient of what evaluate_block() returns: adds to those of the lengths and of the network's
/// parameters.
template <class T>
void add_block_gradient(const ops::RadialBlock& block, const Radial<T>& network,
                        const typename Radial<T>::Matrix& lengths, const typename Radial<T>::Matrix& d_out,
                        typename Radial<T>::Matrix& d_lengths, ops::RadialNetwork& parameters);

}  // namespace bitr::cpu
