#include <algorithm>
#include <cmath>

#include "cpu/kernel.hpp"

namespace bitr::cpu {
namespace {

template <class T>
class EdgeGeometryKernel : public Kernel<T> {
 public:
  explicit EdgeGeometryKernel(const ops::EdgeGeometry& op) : op_(op) {}

  void run(const Arguments& args) const override {
    const Slot& edges = args.in[2];
    const std::size_t k = edges.per_row, width = 3 * op_.sides;
    const T *centres = args.in[0].as<T>(), *neighbors = args.in[1].as<T>();
    const auto* index = edges.as<std::uint32_t>();
    T *lengths = args.out[0].as<T>(), *directions = args.out[1].as<T>();
    args.pool.parallel_for(args.rows(edges), 256, [&](std::size_t begin, std::size_t end) {
      for (std::size_t e = begin * k; e < end * k; ++e) {
        const T *to = centres + e / k * width, *from = neighbors + index[e] * width;
        for (int s = 0; s < op_.sides; ++s) {
          const T x = to[3 * s] - from[3 * s], y = to[3 * s + 1] - from[3 * s + 1],
                  z = to[3 * s + 2] - from[3 * s + 2];
          const T length = std::sqrt(x * x + y * y + z * z);
          const T scale = 1 / std::max(length, static_cast<T>(ops::direction_eps));
          lengths[e * op_.sides + s] = length;
          T* unit = directions + e * width + 3 * s;
          unit[0] = y * scale;
          unit[1] = z * scale;
          unit[2] = x * scale;
        }
      }
    });
  }

 private:
  const ops::EdgeGeometry op_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::EdgeGeometry& op) {
  return std::make_unique<EdgeGeometryKernel<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::EdgeGeometry& op) {
  return std::make_unique<EdgeGeometryKernel<double>>(op);
}

}  // namespace bitr::cpu
