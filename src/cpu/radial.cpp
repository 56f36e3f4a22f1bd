#include "cpu/radial.hpp"

#include <cmath>

namespace bitr::cpu {

template <class T>
Radial<T>::Radial(const ops::RadialNetwork& network)
    : scale_degree_(network.scale_degree),
      eps_(static_cast<T>(network.eps)),
      w1_(network.w1.cast<T>()),
      w2_(network.w2.cast<T>()),
      w3_(network.w3.cast<T>()),
      gain1_(network.gain1.cast<T>()),
      bias1_(network.bias1.cast<T>()),
      c2_(network.c2.cast<T>()),
      gain2_(network.gain2.cast<T>()),
      bias2_(network.bias2.cast<T>()),
      c3_(network.c3.cast<T>()) {}

template <class T>
void Radial<T>::activate(Matrix& hidden, const Vector& gain, const Vector& bias, T eps) {
  for (Eigen::Index e = 0; e < hidden.cols(); ++e) {
    auto column = hidden.col(e).array();
    if (gain.size()) {
      column -= column.mean();
      const T variance = column.square().mean() + eps;
      const T scale = variance > 0 ? 1 / std::sqrt(variance) : T{0};
      column = column * scale * gain.array() + bias.array();
    }
    column = (column > 0).select(column, static_cast<T>(ops::leaky_slope) * column);
  }
}

template <class T>
typename Radial<T>::Matrix Radial<T>::evaluate(const Matrix& lengths) const {
  Matrix hidden = w1_ * lengths;
  activate(hidden, gain1_, bias1_, eps_);
  Matrix second = w2_ * hidden;
  if (scale_degree_ == 0) second.colwise() += c2_;
  activate(second, gain2_, bias2_, eps_);
  Matrix out = w3_ * second;
  if (scale_degree_ == 0) out.colwise() += c3_;
  return out;
}

template <class T>
typename Radial<T>::Matrix evaluate_block(const ops::RadialBlock& block, const Radial<T>& network,
                                          const typename Radial<T>::Matrix& lengths) {
  using Matrix = typename Radial<T>::Matrix;
  if (block.tying == ops::Tying::direct) return network.evaluate(lengths);

  const Matrix reversed = network.evaluate(lengths.colwise().reverse());
  // The network that answers belongs to the mirrored pair: its frequencies are (freq2, freq1).
  const int a = block.freq1(), b = block.freq2(), channels = block.out_channels * block.in_channels;
  Matrix exchanged(reversed.rows(), reversed.cols());
  for (int c = 0; c < channels; ++c)
    for (int i = 0; i < a; ++i)
      for (int j = 0; j < b; ++j) exchanged.row((c * a + i) * b + j) = reversed.row((c * b + j) * a + i);
  if (block.tying == ops::Tying::mirrored) return exchanged;
  return (network.evaluate(lengths) + exchanged) / 2;
}

template class Radial<float>;
template class Radial<double>;
template Radial<float>::Matrix evaluate_block(const ops::RadialBlock&, const Radial<float>&,
                                              const Radial<float>::Matrix&);
template Radial<double>::Matrix evaluate_block(const ops::RadialBlock&, const Radial<double>&,
                                               const Radial<double>::Matrix&);

}  // namespace bitr::cpu
