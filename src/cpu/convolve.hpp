// An equivariant convolution's kernels, as defined: shared by the operation and its gradient.
#pragma once

#include <map>
#include <utility>

#include "cpu/radial.hpp"
#include "irreps/clebsch_gordan.hpp"
#include "irreps/harmonics.hpp"

namespace bitr::cpu {

/// Y_0 … of a direction in the order (y, z, x).
template <class T>
using Harmonics = Eigen::Matrix<T, irreps::harmonic_count(irreps::max_harmonic_degree), 1>;

template <class T>
Harmonics<T> edge_harmonics(const T* yzx) {
  const T xyz[3] = {yzx[2], yzx[0], yzx[1]};
  Harmonics<T> harmonics;
  irreps::spherical_harmonics(irreps::max_harmonic_degree, xyz, harmonics.data());
  return harmonics;
}

/// K_J(v)[o, i] of one side for one pair of degrees: the sum over m of Q(i, o)[(i, o), (J, m)] Y_J(v)_m.
template <class T>
class SideKernel {
 public:
  using Matrix = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic>;
  using Matrices = std::vector<Matrix>;

  SideKernel(int in, int out) : in_(2 * in + 1), out_(2 * out + 1) {
    for (int J = std::abs(in - out); J <= in + out; ++J)
      parts_.push_back({J, irreps::clebsch_gordan_block(in, out, J).cast<T>()});
  }

  /// Writes freq matrices out × in.
  void evaluate(const Harmonics<T>& harmonics, Matrices& kernels) const {
    kernels.resize(parts_.size());
    for (std::size_t f = 0; f < parts_.size(); ++f) {
      const auto& [J, q] = parts_[f];
      const Eigen::Matrix<T, Eigen::Dynamic, 1> column = q * harmonics.segment(J * J, 2 * J + 1);
      // Rows of Q are (i slow, o fast): a column-major out × in matrix.
      kernels[f] = Eigen::Map<const Matrix>(column.data(), out_, in_);
    }
  }

  /// Adds the gradient of the harmonics, from that of the kernels.
  void add_gradient(const Matrices& kernels, Harmonics<T>& harmonics) const {
    for (std::size_t f = 0; f < parts_.size(); ++f) {
      const auto& [J, q] = parts_[f];
      harmonics.segment(J * J, 2 * J + 1) +=
          q.transpose() *
          Eigen::Map<const Eigen::Matrix<T, Eigen::Dynamic, 1>>(kernels[f].data(), in_ * out_);
    }
  }

 private:
  int in_, out_;
  std::vector<std::pair<int, Matrix>> parts_;
};

/// One pair of degrees of a convolution.
template <class T>
struct ConvolveBlock {
  using Matrix = typename SideKernel<T>::Matrix;
  using Matrices = typename SideKernel<T>::Matrices;

  ops::RadialBlock radial;
  const Radial<T>* network;
  SideKernel<T> first, second;
  int in_offset, out_offset;

  /// The kernels of both sides; a one-sided convolution's second one is 1.
  void kernels(const Harmonics<T>& first_side, const Harmonics<T>* second_side, Matrices& a,
               Matrices& b) const {
    first.evaluate(first_side, a);
    if (second_side)
      second.evaluate(*second_side, b);
    else
      b.assign(1, Matrix::Ones(1, 1));
  }

  /// A column K_{J₁} f[c_in] K_{J₂}ᵀ, row by row, for every (c_in, J₁, J₂), the last fastest.
  void turn(const Matrices& a, const Matrices& b, const T* feature, Matrix& turned) const {
    const int dim_in = radial.in.dim(), dim_out = radial.out.dim();
    turned.resize(dim_out, radial.in_channels * radial.freq());
    RowMatrix<T> product;
    Eigen::Index column = 0;
    for (int c = 0; c < radial.in_channels; ++c) {
      const Eigen::Map<const RowMatrix<T>> f(feature + c * dim_in, 2 * radial.in.p + 1, 2 * radial.in.q + 1);
      for (const Matrix& one : a)
        for (const Matrix& two : b) {
          product.noalias() = one * f * two.transpose();
          turned.col(column++) =
              Eigen::Map<const Eigen::Matrix<T, Eigen::Dynamic, 1>>(product.data(), dim_out);
        }
    }
  }
};

/// The blocks of a convolution and the networks they share.
template <class T>
class ConvolveBlocks {
 public:
  explicit ConvolveBlocks(const ops::Convolve& op) {
    for (const ops::RadialBlock& radial : op.blocks) {
      auto& network = networks_[radial.network.get()];
      if (!network) network = std::make_unique<Radial<T>>(*radial.network);
      blocks_.push_back({radial, network.get(), SideKernel<T>(radial.in.p, radial.out.p),
                         SideKernel<T>(radial.in.q, radial.out.q), op.fiber_in.offset(radial.in),
                         op.fiber_out.offset(radial.out)});
    }
  }
  auto begin() const { return blocks_.begin(); }
  auto end() const { return blocks_.end(); }

 private:
  std::map<const ops::RadialNetwork*, std::unique_ptr<Radial<T>>> networks_;
  std::vector<ConvolveBlock<T>> blocks_;
};

}  // namespace bitr::cpu
