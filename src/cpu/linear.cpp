#include <algorithm>

#include "cpu/kernel.hpp"

namespace bitr::cpu {
namespace {

// One input's share of one degree.
template <class T>
struct Part {
  std::size_t input;
  int in_offset, out_offset, dim;
  RowMatrix<T> weights;  // channels out × channels in
};

template <class T>
class LinearKernel : public Kernel<T> {
 public:
  explicit LinearKernel(const ops::Linear& op) {
    for (const auto& [d, matrix] : op.weights) {
      int column = 0;
      for (std::size_t i = 0; i < op.fiber_in.size(); ++i) {
        const int channels = op.fiber_in[i].channels(d);
        if (channels == 0) continue;
        Eigen::MatrixXd weights = matrix.middleCols(column, channels);
        if (op.skip.count(d))
          weights.middleRows(column, channels) += Eigen::MatrixXd::Identity(channels, channels);
        parts_.push_back(
            {i, op.fiber_in[i].offset(d), op.fiber_out.offset(d), d.dim(), weights.template cast<T>()});
        column += channels;
      }
    }
  }

  void run(const Arguments& args) const override {
    const Slot& out = args.out[0];
    args.pool.parallel_for(args.rows(out), 256, [&](std::size_t begin, std::size_t end) {
      for (std::size_t row = begin; row < end; ++row) {
        T* to = out.as<T>() + row * out.stride();
        std::fill_n(to, out.stride(), T{0});
        for (const Part<T>& part : parts_) {
          const Slot& in = args.in[part.input];
          const T* from = in.as<T>() + row * in.stride() + part.in_offset;
          const Eigen::Map<const RowMatrix<T>> x(from, part.weights.cols(), part.dim);
          Eigen::Map<RowMatrix<T>> y(to + part.out_offset, part.weights.rows(), part.dim);
          y += part.weights.lazyProduct(x);
        }
      }
    });
  }

 private:
  std::vector<Part<T>> parts_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::Linear& op) {
  return std::make_unique<LinearKernel<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::Linear& op) {
  return std::make_unique<LinearKernel<double>>(op);
}

}  // namespace bitr::cpu
