#include <algorithm>
#include <cmath>

#include "cpu/point_attention.hpp"
#include "cpu/projected_relu.hpp"

namespace bitr::cpu {
namespace {

template <class T>
class MeanDirectionKernel : public Kernel<T> {
 public:
  explicit MeanDirectionKernel(const ops::MeanDirection& op)
      : op_(op),
        scalars_(op.scalars.cast<T>()),
        slopes_(op.slopes.cast<T>()),
        general_(op.general),
        plane_(op.general.plane.cast<T>()),
        constant_(static_cast<T>(op.constant)) {}

  void run(const Arguments& args) const override {
    const Slot &edges = args.in[1], &out = args.out[0];
    const int k = edges.per_row;
    const PointInputs<T> inputs{&constant_,         0,          edges.as<std::uint32_t>(), args.in[0].as<T>(),
                                args.in[0].as<T>(), out.as<T>()};
    args.pool.parallel_for(args.rows(out), 256, [&](std::size_t begin, std::size_t end) {
      for (std::size_t row = begin; row < end; ++row) {
        T mean[3];
        if (!mean_of(inputs, k, row, mean)) {
          point_attention_rows(op_.general, general_, plane_, inputs, k, row, row + 1);
          continue;
        }
        T* to = out.as<T>() + row * out.stride();
        to = std::copy(scalars_.begin(), scalars_.end(), to);
        for (Eigen::Index c = 0; c < slopes_.size(); ++c)
          for (int a = 0; a < 3; ++a) to[3 * c + a] = slopes_[c] * mean[a];
        if (op_.general.relu) projected_relu(plane_, op_.general.relu_square, 3, to);
      }
    });
  }

 private:
  // False if some edge has length zero.
  static bool mean_of(const PointInputs<T>& in, int k, std::size_t row, T* mean) {
    const T* centre = in.centres + 3 * row;
    T sum[3] = {};
    bool distinct = true;
    for (int j = 0; j < k; ++j) {
      const T* at = in.neighbors + 3 * std::size_t{in.index[row * k + j]};
      const T d[3] = {centre[1] - at[1], centre[2] - at[2], centre[0] - at[0]};
      const T square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
      distinct = distinct && square > 0;
      const T scale = 1 / std::max(std::sqrt(square), static_cast<T>(ops::direction_eps));
      for (int a = 0; a < 3; ++a) sum[a] += d[a] * scale;
    }
    for (int a = 0; a < 3; ++a) mean[a] = sum[a] / static_cast<T>(k);
    return distinct;
  }

  const ops::MeanDirection op_;
  const Eigen::Matrix<T, Eigen::Dynamic, 1> scalars_, slopes_;
  const PointCoefficients<T> general_;
  const RowMatrix<T> plane_;
  const T constant_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::MeanDirection& op) {
  return std::make_unique<MeanDirectionKernel<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::MeanDirection& op) {
  return std::make_unique<MeanDirectionKernel<double>>(op);
}

}  // namespace bitr::cpu
