#include "cpu/convolve.hpp"

#include <algorithm>

namespace bitr::cpu {
namespace {

template <class T>
class ConvolveKernel : public Kernel<T> {
  using Matrix = typename ConvolveBlock<T>::Matrix;

 public:
  explicit ConvolveKernel(const ops::Convolve& op) : op_(op), blocks_(op_) {}

  void run(const Arguments& args) const override {
    const Slot &features = args.in[0], &edges = args.in[1];
    const std::size_t k = edges.per_row, sides = op_.sides, in = features.stride(),
                      out = op_.fiber_out.size();
    const auto* index = edges.as<std::uint32_t>();
    args.pool.parallel_for(args.rows(edges), 8, [&](std::size_t begin, std::size_t end) {
      const std::size_t e0 = begin * k, count = (end - begin) * k;
      const Matrix lengths = Eigen::Map<const Matrix>(args.in[2].as<T>() + e0 * sides, sides, count);
      T* result = args.out[0].as<T>() + e0 * out;
      std::fill_n(result, count * out, T{0});
      typename ConvolveBlock<T>::Matrices first, second;
      Matrix turned;
      for (const ConvolveBlock<T>& block : blocks_) {
        const Matrix radial = evaluate_block(block.radial, *block.network, lengths);
        const int channels = block.radial.out_channels, dim = block.radial.out.dim();
        for (std::size_t e = 0; e < count; ++e) {
          const T* direction = args.in[3].as<T>() + (e0 + e) * 3 * sides;
          const Harmonics<T> one = edge_harmonics(direction);
          const Harmonics<T> two = sides == 2 ? edge_harmonics(direction + 3) : one;
          block.kernels(one, sides == 2 ? &two : nullptr, first, second);
          block.turn(first, second, features.as<T>() + index[e0 + e] * in + block.in_offset, turned);
          // out[c_out] += Σ_{c_in, J₁, J₂} R[c_out, c_in, J₁, J₂] · K_{J₁} f[c_in] K_{J₂}ᵀ
          Eigen::Map<Matrix>(result + e * out + block.out_offset, dim, channels).noalias() +=
              turned * Eigen::Map<const Matrix>(radial.col(e).data(), turned.cols(), channels);
        }
      }
    });
  }

 private:
  const ops::Convolve op_;
  const ConvolveBlocks<T> blocks_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::Convolve& op) {
  return std::make_unique<ConvolveKernel<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::Convolve& op) {
  return std::make_unique<ConvolveKernel<double>>(op);
}

}  // namespace bitr::cpu
