#include <algorithm>
#include <cmath>

#include "cpu/kernel.hpp"

namespace bitr::cpu {
namespace {

template <class T>
class InputFeaturesKernel : public Kernel<T> {
 public:
  explicit InputFeaturesKernel(const ops::InputFeatures& op) : op_(op) {}

  void run(const Arguments& args) const override {
    const Slot& out = args.out[0];
    std::size_t next = 0;
    const auto attribute = [&](bool used) { return used ? args.in[next++].template as<T>() : nullptr; };
    const T* colors = attribute(op_.colors);
    const T* normals = attribute(op_.normals);
    const T* offsets = attribute(op_.offsets);
    args.pool.parallel_for(args.rows(out), 4096, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        T* row = out.as<T>() + i * out.stride();
        if (colors)
          row = std::copy_n(colors + 3 * i, 3, row);
        else
          *row++ = static_cast<T>(ops::constant_feature);
        const auto product = [i](const T* a, const T* b) {
          return a[3 * i] * b[3 * i] + a[3 * i + 1] * b[3 * i + 1] + a[3 * i + 2] * b[3 * i + 2];
        };
        if (offsets) *row++ = std::sqrt(product(offsets, offsets));
        if (offsets && normals) *row++ = product(normals, offsets);
        for (const T* vectors : {normals, offsets})
          if (vectors)
            for (int axis : {1, 2, 0}) *row++ = vectors[3 * i + axis];
      }
    });
  }

 private:
  const ops::InputFeatures op_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::InputFeatures& op) {
  return std::make_unique<InputFeaturesKernel<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::InputFeatures& op) {
  return std::make_unique<InputFeaturesKernel<double>>(op);
}

}  // namespace bitr::cpu
