#include <algorithm>

#include "cpu/kernel.hpp"

namespace bitr::cpu {
namespace {

template <class T>
class MergePairsKernel : public Kernel<T> {
 public:
  explicit MergePairsKernel(const ops::MergePairs& op) : m_(op.channels) {}

  void run(const Arguments& args) const override {
    const Slot &positions = args.in[0], &features = args.in[1], &out = args.out[1];
    const std::size_t nodes = args.rows(out);
    for (std::size_t node = 0; node < nodes; ++node) {
      const T* x = positions.as<T>() + 3 * node;
      const T* y = positions.as<T>() + 3 * (node + nodes);
      std::copy_n(y, 3, std::copy_n(x, 3, args.out[0].as<T>() + 6 * node));

      const T* source = features.as<T>() + node * features.stride();
      const T* reference = features.as<T>() + (node + nodes) * features.stride();
      T* to = out.as<T>() + node * out.stride();
      for (int c = 0; c < m_; ++c) *to++ = source[c] + reference[c];
      const T *u = source + m_, *w = reference + m_;
      to = std::copy_n(w, 3 * m_, to);
      to = std::copy_n(u, 3 * m_, to);
      for (int c = 0; c < m_; ++c)
        for (int i = 0; i < 3; ++i)
          for (int j = 0; j < 3; ++j) *to++ = u[3 * c + i] * w[3 * c + j];
    }
  }

 private:
  const int m_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::MergePairs& op) {
  return std::make_unique<MergePairsKernel<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::MergePairs& op) {
  return std::make_unique<MergePairsKernel<double>>(op);
}

}  // namespace bitr::cpu
