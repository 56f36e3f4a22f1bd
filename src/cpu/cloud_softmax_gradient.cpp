#include <algorithm>

#include "cpu/cloud_chunks.hpp"

namespace bitr::cpu {
namespace {

template <class T>
class CloudSoftmaxGradient : public Kernel<T> {
 public:
  explicit CloudSoftmaxGradient(const ops::Gradient<ops::CloudSoftmax>& op)
      : op_(op), channels_(op.op.channels) {}

  void run(const Arguments& args) const override {
    const GradientSlots<ops::CloudSoftmax> slots{op_, args};
    const Slot *grad_output = slots.grad_output(0), *grad_input = slots.grad_input(0);
    if (!grad_input) return;
    const auto chunks = cloud_chunks(args.layout);
    // Σ w g of every chunk, then of its cloud.
    Eigen::ArrayXXd parts = Eigen::ArrayXXd::Zero(channels_, chunks.size());
    Eigen::ArrayXXd means = Eigen::ArrayXXd::Zero(channels_, args.layout.clouds());
    if (grad_output) {
      args.pool.parallel_for(chunks.size(), 1, [&](std::size_t first, std::size_t last) {
        for (std::size_t i = first; i < last; ++i)
          for (std::size_t row = chunks[i].begin; row < chunks[i].end; ++row)
            parts.col(i) += load(slots.out(0), row) * load(*grad_output, row);
      });
      for (std::size_t i = 0; i < chunks.size(); ++i) means.col(chunks[i].cloud) += parts.col(i);
    }
    args.pool.parallel_for(chunks.size(), 1, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i)
        for (std::size_t row = chunks[i].begin; row < chunks[i].end; ++row) {
          T* to = grad_input->as<T>() + row * grad_input->stride();
          std::fill_n(to, grad_input->stride(), T{0});
          if (grad_output)
            Eigen::Map<Eigen::Array<T, Eigen::Dynamic, 1>>(to, channels_) =
                (load(slots.out(0), row) * (load(*grad_output, row) - means.col(chunks[i].cloud)))
                    .template cast<T>();
        }
    });
  }

 private:
  Eigen::ArrayXd load(const Slot& slot, std::size_t row) const {
    return Eigen::Map<const Eigen::Array<T, Eigen::Dynamic, 1>>(slot.as<T>() + row * slot.stride(), channels_)
        .template cast<double>();
  }

  const ops::Gradient<ops::CloudSoftmax> op_;
  const int channels_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::Gradient<ops::CloudSoftmax>& op) {
  return std::make_unique<CloudSoftmaxGradient<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::Gradient<ops::CloudSoftmax>& op) {
  return std::make_unique<CloudSoftmaxGradient<double>>(op);
}

}  // namespace bitr::cpu
