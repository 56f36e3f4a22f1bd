#include <algorithm>

#include "cpu/cloud_chunks.hpp"

namespace bitr::cpu {
namespace {

template <class T>
class CloudSumGradient : public Kernel<T> {
 public:
  explicit CloudSumGradient(const ops::Gradient<ops::CloudSum>& op) : op_(op) {}

  void run(const Arguments& args) const override {
    const GradientSlots<ops::CloudSum> slots{op_, args};
    const Slot &weights = slots.in(0), &values = slots.in(1);
    const Slot *grad_output = slots.grad_output(0), *to_weights = slots.grad_input(0),
               *to_values = slots.grad_input(1);
    const int channels = op_.op.channels, skip = op_.op.skip, width = slots.out(0).width;
    const auto chunks = cloud_chunks(args.layout);
    args.pool.parallel_for(chunks.size(), 1, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) {
        RowMatrix<double> sums = RowMatrix<double>::Zero(channels, width);
        if (grad_output)
          sums = Eigen::Map<const RowMatrix<T>>(grad_output->as<T>() + chunks[i].cloud * sums.size(),
                                                channels, width)
                     .template cast<double>();
        for (std::size_t row = chunks[i].begin; row < chunks[i].end; ++row) {
          if (to_weights)
            vector(*to_weights, row, 0, channels) =
                (sums * vector(values, row, skip, width).template cast<double>()).template cast<T>();
          if (to_values) {
            vector(*to_values, row, 0, skip).setZero();
            vector(*to_values, row, skip, width) =
                (sums.transpose() * vector(weights, row, 0, channels).template cast<double>())
                    .template cast<T>();
          }
        }
      }
    });
  }

 private:
  static auto vector(const Slot& slot, std::size_t row, int skip, int count) {
    return Eigen::Map<Eigen::Matrix<T, Eigen::Dynamic, 1>>(slot.as<T>() + row * slot.stride() + skip, count);
  }

  const ops::Gradient<ops::CloudSum> op_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::Gradient<ops::CloudSum>& op) {
  return std::make_unique<CloudSumGradient<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::Gradient<ops::CloudSum>& op) {
  return std::make_unique<CloudSumGradient<double>>(op);
}

}  // namespace bitr::cpu
