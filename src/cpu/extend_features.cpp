#include <algorithm>

#include "cpu/kernel.hpp"

namespace bitr::cpu {
namespace {

template <class T>
class ExtendFeaturesKernel : public Kernel<T> {
 public:
  explicit ExtendFeaturesKernel(const ops::ExtendFeatures& op)
      : op_(op), scalars_(op.fiber.channels({0, 0})), vectors_(3 * op.fiber.channels({1, 0})) {}

  void run(const Arguments& args) const override {
    const Slot &features = args.in[0], &means = args.in[1], &globals = args.in[2], &out = args.out[0];
    const auto& layout = args.layout;
    for (std::uint32_t cloud = 0; cloud < layout.clouds(); ++cloud) {
      const std::size_t base = layout.cloud_offset[cloud];
      const auto row_of = [](const Slot& slot, std::size_t row) {
        return slot.as<T>() + row * slot.stride();
      };
      args.pool.parallel_for(
          layout.cloud_offset[cloud + 1] - base, 1024, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = base + begin; i < base + end; ++i) {
              const T* own = row_of(features, i);
              T* to = row_of(out, i);
              to = std::copy_n(own, scalars_, to);
              to = std::copy_n(row_of(globals, cloud), op_.global_channels, to);
              to = std::copy_n(row_of(globals, layout.other(cloud)), op_.global_channels, to);
              to = std::copy_n(row_of(means, cloud), scalars_, to);
              to = std::copy_n(row_of(means, layout.other(cloud)), scalars_, to);
              to = std::copy_n(own + scalars_, vectors_, to);
              std::copy_n(row_of(means, cloud) + scalars_, vectors_, to);
            }
          });
    }
  }

 private:
  const ops::ExtendFeatures op_;
  const int scalars_, vectors_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::ExtendFeatures& op) {
  return std::make_unique<ExtendFeaturesKernel<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::ExtendFeatures& op) {
  return std::make_unique<ExtendFeaturesKernel<double>>(op);
}

}  // namespace bitr::cpu
