#include "cpu/kernel.hpp"

namespace bitr::cpu {
namespace {

template <class T>
class SumKernel : public Kernel<T> {
 public:
  void run(const Arguments& args) const override {
    const std::size_t stride = args.out[0].stride();
    args.pool.parallel_for(args.rows(args.out[0]), 1024, [&](std::size_t begin, std::size_t end) {
      using Numbers = Eigen::Array<T, Eigen::Dynamic, 1>;
      const auto count = static_cast<Eigen::Index>((end - begin) * stride);
      const auto part = [&](const Slot& slot) {
        return Eigen::Map<Numbers>(slot.as<T>() + begin * stride, count);
      };
      part(args.out[0]) = part(args.in[0]);
      for (const Slot& more : args.in.subspan(1)) part(args.out[0]) += part(more);
    });
  }
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::Sum&) {
  return std::make_unique<SumKernel<float>>();
}
template <>
KernelPtr<double> make_kernel(const ops::Sum&) {
  return std::make_unique<SumKernel<double>>();
}

}  // namespace bitr::cpu
