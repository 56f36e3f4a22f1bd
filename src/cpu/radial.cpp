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
void Radial<T>::activate_gradient(const Matrix& hidden, const Vector& gain, const Vector& bias, T eps,
                                  Matrix& d, Eigen::VectorXd& d_gain, Eigen::VectorXd& d_bias) {
  using Array = Eigen::Array<T, Eigen::Dynamic, 1>;
  for (Eigen::Index e = 0; e < hidden.cols(); ++e) {
    auto column = d.col(e).array();
    Array normed = hidden.col(e).array();
    T scale = 1;
    if (gain.size()) {
      normed -= normed.mean();
      const T variance = normed.square().mean() + eps;
      scale = variance > 0 ? 1 / std::sqrt(variance) : T{0};
      normed *= scale;
    }
    const Array made = gain.size() ? Array(normed * gain.array() + bias.array()) : normed;
    column = (made > 0).select(column, static_cast<T>(ops::leaky_slope) * column);
    if (!gain.size()) continue;
    d_gain.array() += (column * normed).template cast<double>();
    d_bias.array() += column.template cast<double>();
    column *= gain.array();
    const T along = (column * normed).mean(), mean = column.mean();
    column = scale * (column - mean - normed * along);
  }
}

template <class T>
typename Radial<T>::Matrix Radial<T>::gradient(const Matrix& lengths, const Matrix& d_out,
                                               ops::RadialNetwork& parameters) const {
  const Matrix first = w1_ * lengths;
  Matrix hidden = first;
  activate(hidden, gain1_, bias1_, eps_);
  Matrix second = w2_ * hidden;
  if (scale_degree_ == 0) second.colwise() += c2_;
  Matrix last = second;
  activate(last, gain2_, bias2_, eps_);

  parameters.w3 += (d_out * last.transpose()).template cast<double>();
  if (scale_degree_ == 0) parameters.c3 += d_out.rowwise().sum().template cast<double>();
  Matrix d = w3_.transpose() * d_out;
  activate_gradient(second, gain2_, bias2_, eps_, d, parameters.gain2, parameters.bias2);
  parameters.w2 += (d * hidden.transpose()).template cast<double>();
  if (scale_degree_ == 0) parameters.c2 += d.rowwise().sum().template cast<double>();
  d = w2_.transpose() * d;
  activate_gradient(first, gain1_, bias1_, eps_, d, parameters.gain1, parameters.bias1);
  parameters.w1 += (d * lengths.transpose()).template cast<double>();
  return w1_.transpose() * d;
}

namespace {

// Rows (channels, freq1, freq2) from or to (channels, freq2, freq1): the network that answers belongs to the
// mirrored pair.
template <class Matrix>
Matrix exchange(const Matrix& rows, int channels, int freq1, int freq2) {
  Matrix exchanged(rows.rows(), rows.cols());
  for (int c = 0; c < channels; ++c)
    for (int i = 0; i < freq1; ++i)
      for (int j = 0; j < freq2; ++j)
        exchanged.row((c * freq1 + i) * freq2 + j) = rows.row((c * freq2 + j) * freq1 + i);
  return exchanged;
}

}  // namespace

template <class T>
typename Radial<T>::Matrix evaluate_block(const ops::RadialBlock& block, const Radial<T>& network,
                                          const typename Radial<T>::Matrix& lengths) {
  using Matrix = typename Radial<T>::Matrix;
  if (block.tying == ops::Tying::direct) return network.evaluate(lengths);

  const Matrix exchanged =
      exchange<Matrix>(network.evaluate(lengths.colwise().reverse()), block.out_channels * block.in_channels,
                       block.freq1(), block.freq2());
  if (block.tying == ops::Tying::mirrored) return exchanged;
  return (network.evaluate(lengths) + exchanged) / 2;
}

template <class T>
void add_block_gradient(const ops::RadialBlock& block, const Radial<T>& network,
                        const typename Radial<T>::Matrix& lengths, const typename Radial<T>::Matrix& d_out,
                        typename Radial<T>::Matrix& d_lengths, ops::RadialNetwork& parameters) {
  using Matrix = typename Radial<T>::Matrix;
  const T share = block.tying == ops::Tying::symmetrised ? T{1} / 2 : T{1};
  if (block.tying != ops::Tying::mirrored) d_lengths += network.gradient(lengths, share * d_out, parameters);
  if (block.tying != ops::Tying::direct)
    d_lengths += network
                     .gradient(lengths.colwise().reverse(),
                               exchange<Matrix>(share * d_out, block.out_channels * block.in_channels,
                                                block.freq2(), block.freq1()),
                               parameters)
                     .colwise()
                     .reverse();
}

template class Radial<float>;
template class Radial<double>;
template Radial<float>::Matrix evaluate_block(const ops::RadialBlock&, const Radial<float>&,
                                              const Radial<float>::Matrix&);
template Radial<double>::Matrix evaluate_block(const ops::RadialBlock&, const Radial<double>&,
                                               const Radial<double>::Matrix&);

template void add_block_gradient(const ops::RadialBlock&, const Radial<float>&, const Radial<float>::Matrix&,
                                 const Radial<float>::Matrix&, Radial<float>::Matrix&, ops::RadialNetwork&);
template void add_block_gradient(const ops::RadialBlock&, const Radial<double>&,
                                 const Radial<double>::Matrix&, const Radial<double>::Matrix&,
                                 Radial<double>::Matrix&, ops::RadialNetwork&);

}  // namespace bitr::cpu
