#include <algorithm>

#include "cpu/kernel.hpp"

namespace bitr::cpu {
namespace {

template <class T>
class InputFeaturesKernel : public Kernel<T> {
 public:
  explicit InputFeaturesKernel(const ops::InputFeatures& op) : op_(op) {}

  void run(const Arguments& args) const override {
    const Slot& out = args.out[0];
    const T* colors = op_.colors ? args.in.front().as<T>() : nullptr;
    const T* normals = op_.normals ? args.in.back().as<T>() : nullptr;
    args.pool.parallel_for(args.rows(out), 4096, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        T* row = out.as<T>() + i * out.stride();
        if (colors)
          row = std::copy_n(colors + 3 * i, 3, row);
        else
          *row++ = static_cast<T>(ops::constant_feature);
        if (normals)
          for (int axis : {1, 2, 0}) *row++ = normals[3 * i + axis];
      }
    });
  }

 private:
  const ops::InputFeatures op_;
};

}  // namespace

template <class T>
KernelPtr<T> make_kernel(const ops::InputFeatures& op) {
  return std::make_unique<InputFeaturesKernel<T>>(op);
}
template KernelPtr<float> make_kernel(const ops::InputFeatures&);
template KernelPtr<double> make_kernel(const ops::InputFeatures&);

}  // namespace bitr::cpu
