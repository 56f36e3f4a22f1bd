#include <algorithm>

#include "cpu/kernel.hpp"

namespace bitr::cpu {
namespace {

template <class T>
class MergePairsGradient : public Kernel<T> {
 public:
  explicit MergePairsGradient(const ops::Gradient<ops::MergePairs>& op) : op_(op), m_(op.op.channels) {}

  void run(const Arguments& args) const override {
    const GradientSlots<ops::MergePairs> slots{op_, args};
    const std::size_t nodes = args.rows(slots.out(1));
    if (const Slot* to = slots.grad_input(0)) positions(slots.grad_output(0), *to, nodes);
    if (const Slot* to = slots.grad_input(1)) features(slots.in(1), slots.grad_output(1), *to, nodes);
  }

 private:
  static void positions(const Slot* grad_output, const Slot& grad_input, std::size_t nodes) {
    T* to = grad_input.as<T>();
    std::fill_n(to, 6 * nodes, T{0});
    if (!grad_output) return;
    for (std::size_t node = 0; node < nodes; ++node) {
      const T* from = grad_output->as<T>() + 6 * node;
      std::copy_n(from, 3, to + 3 * node);
      std::copy_n(from + 3, 3, to + 3 * (node + nodes));
    }
  }

  void features(const Slot& in, const Slot* grad_output, const Slot& grad_input, std::size_t nodes) const {
    const std::size_t width = grad_input.stride();
    std::fill_n(grad_input.as<T>(), 2 * nodes * width, T{0});
    if (!grad_output) return;
    for (std::size_t node = 0; node < nodes; ++node) {
      const T *u = in.as<T>() + node * width + m_, *w = in.as<T>() + (node + nodes) * width + m_;
      T* source = grad_input.as<T>() + node * width;
      T* reference = grad_input.as<T>() + (node + nodes) * width;
      const T* from = grad_output->as<T>() + node * grad_output->stride();
      std::copy_n(from, m_, source);
      std::copy_n(from, m_, reference);
      std::copy_n(from + m_, 3 * m_, reference + m_);
      std::copy_n(from + 4 * m_, 3 * m_, source + m_);
      const T* outer = from + 7 * m_;
      for (int c = 0; c < m_; ++c)
        for (int i = 0; i < 3; ++i)
          for (int j = 0; j < 3; ++j, ++outer) {
            source[m_ + 3 * c + i] += *outer * w[3 * c + j];
            reference[m_ + 3 * c + j] += *outer * u[3 * c + i];
          }
    }
  }

  const ops::Gradient<ops::MergePairs> op_;
  const int m_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::Gradient<ops::MergePairs>& op) {
  return std::make_unique<MergePairsGradient<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::Gradient<ops::MergePairs>& op) {
  return std::make_unique<MergePairsGradient<double>>(op);
}

}  // namespace bitr::cpu
