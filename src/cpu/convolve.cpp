#include <map>

#include "cpu/radial.hpp"
#include "irreps/clebsch_gordan.hpp"
#include "irreps/harmonics.hpp"

namespace bitr::cpu {
namespace {

template <class T>
using Matrix = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic>;

// K_J(v)[o, i] of one side for one pair of degrees: the sum over m of Q(i, o)[(i, o), (J, m)] Y_J(v)_m.
template <class T>
class SideKernel {
 public:
  SideKernel(int in, int out) : in_(2 * in + 1), out_(2 * out + 1) {
    for (int J = std::abs(in - out); J <= in + out; ++J)
      parts_.push_back({J, irreps::clebsch_gordan_block(in, out, J).cast<T>()});
  }
  int freq() const { return static_cast<int>(parts_.size()); }

  // harmonics: Y_0 … of the direction. Writes freq matrices out × in.
  void evaluate(const T* harmonics, std::vector<Matrix<T>>& kernels) const {
    kernels.resize(parts_.size());
    for (std::size_t f = 0; f < parts_.size(); ++f) {
      const auto& [J, q] = parts_[f];
      const Eigen::Matrix<T, Eigen::Dynamic, 1> column =
          q * Eigen::Map<const Eigen::Matrix<T, Eigen::Dynamic, 1>>(harmonics + J * J, 2 * J + 1);
      // Rows of Q are (i slow, o fast): a column-major out × in matrix.
      kernels[f] = Eigen::Map<const Matrix<T>>(column.data(), out_, in_);
    }
  }

 private:
  int in_, out_;
  std::vector<std::pair<int, Matrix<T>>> parts_;
};

template <class T>
struct Block {
  ops::RadialBlock radial;
  const Radial<T>* network;
  SideKernel<T> first, second;
  int in_offset, out_offset;
};

template <class T>
class ConvolveKernel : public Kernel<T> {
 public:
  explicit ConvolveKernel(const ops::Convolve& op) : op_(op) {
    for (const ops::RadialBlock& radial : op_.blocks) {
      auto& network = networks_[radial.network.get()];
      if (!network) network = std::make_unique<Radial<T>>(*radial.network);
      blocks_.push_back({radial, network.get(), SideKernel<T>(radial.in.p, radial.out.p),
                         SideKernel<T>(radial.in.q, radial.out.q), op_.fiber_in.offset(radial.in),
                         op_.fiber_out.offset(radial.out)});
    }
  }

  void run(const Arguments& args) const override {
    const Slot &features = args.in[0], &edges = args.in[1];
    const std::size_t k = edges.per_row, sides = op_.sides, in = features.stride(),
                      out = op_.fiber_out.size();
    const auto* index = edges.as<std::uint32_t>();
    args.pool.parallel_for(args.rows(edges), 8, [&](std::size_t begin, std::size_t end) {
      const std::size_t e0 = begin * k, count = (end - begin) * k;
      const Matrix<T> lengths = Eigen::Map<const Matrix<T>>(args.in[2].as<T>() + e0 * sides, sides, count);
      T* result = args.out[0].as<T>() + e0 * out;
      std::fill_n(result, count * out, T{0});
      for (const Block<T>& block : blocks_) {
        const Matrix<T> radial = evaluate_block(block.radial, *block.network, lengths);
        std::vector<Matrix<T>> first, second;
        Matrix<T> turned;
        for (std::size_t e = 0; e < count; ++e) {
          kernels(block, args.in[3].as<T>() + (e0 + e) * 3 * sides, first, second);
          apply(block, first, second, radial.col(e).data(),
                features.as<T>() + index[e0 + e] * in + block.in_offset, result + e * out + block.out_offset,
                turned);
        }
      }
    });
  }

 private:
  void kernels(const Block<T>& block, const T* direction, std::vector<Matrix<T>>& first,
               std::vector<Matrix<T>>& second) const {
    T harmonics[irreps::harmonic_count(irreps::max_harmonic_degree)];
    const auto side = [&](const SideKernel<T>& kernel, const T* yzx, std::vector<Matrix<T>>& out) {
      const T xyz[3] = {yzx[2], yzx[0], yzx[1]};
      irreps::spherical_harmonics(irreps::max_harmonic_degree, xyz, harmonics);
      kernel.evaluate(harmonics, out);
    };
    side(block.first, direction, first);
    if (op_.sides == 2)
      side(block.second, direction + 3, second);
    else
      second.assign(1, Matrix<T>::Ones(1, 1));
  }

  // out[c_out] += Σ_{c_in, J₁, J₂} R[c_out, c_in, J₁, J₂] · K_{J₁} f[c_in] K_{J₂}ᵀ
  void apply(const Block<T>& block, const std::vector<Matrix<T>>& first, const std::vector<Matrix<T>>& second,
             const T* radial, const T* feature, T* out, Matrix<T>& turned) const {
    const ops::RadialBlock& r = block.radial;
    const int rows_in = 2 * r.in.p + 1, cols_in = 2 * r.in.q + 1, dim_in = r.in.dim(), dim_out = r.out.dim();
    turned.resize(dim_out, r.in_channels * r.freq());
    RowMatrix<T> product;
    for (int c = 0; c < r.in_channels; ++c) {
      const Eigen::Map<const RowMatrix<T>> f(feature + c * dim_in, rows_in, cols_in);
      for (std::size_t a = 0; a < first.size(); ++a)
        for (std::size_t b = 0; b < second.size(); ++b) {
          product.noalias() = first[a] * f * second[b].transpose();
          turned.col((c * first.size() + a) * second.size() + b) =
              Eigen::Map<const Eigen::Matrix<T, Eigen::Dynamic, 1>>(product.data(), dim_out);
        }
    }
    const Eigen::Map<const Matrix<T>> weights(radial, turned.cols(), r.out_channels);
    Eigen::Map<Matrix<T>>(out, dim_out, r.out_channels).noalias() += turned * weights;
  }

  const ops::Convolve op_;
  std::map<const ops::RadialNetwork*, std::unique_ptr<Radial<T>>> networks_;
  std::vector<Block<T>> blocks_;
};

}  // namespace

template <class T>
KernelPtr<T> make_kernel(const ops::Convolve& op) {
  return std::make_unique<ConvolveKernel<T>>(op);
}
template KernelPtr<float> make_kernel(const ops::Convolve&);
template KernelPtr<double> make_kernel(const ops::Convolve&);

}  // namespace bitr::cpu
