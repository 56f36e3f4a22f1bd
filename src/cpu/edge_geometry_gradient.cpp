#include <Eigen/Geometry>

#include "cpu/neighbour_scatter.hpp"

namespace bitr::cpu {
namespace {

template <class T>
using Vector3 = Eigen::Matrix<T, 3, 1>;

template <class T>
class EdgeGeometryGradient : public Kernel<T> {
 public:
  explicit EdgeGeometryGradient(const ops::Gradient<ops::EdgeGeometry>& op) : op_(op) {}

  void run(const Arguments& args) const override {
    const GradientSlots<ops::EdgeGeometry> slots{op_, args};
    const Slot& index = slots.in(2);
    const std::size_t k = index.per_row, width = 3 * op_.op.sides;
    // The gradient with respect to each edge's start: minus that of its difference.
    std::vector<T> starts(args.rows(index) * k * width);
    args.pool.parallel_for(args.rows(index), 256, [&](std::size_t begin, std::size_t end) {
      for (std::size_t row = begin; row < end; ++row) {
        Eigen::Matrix<T, Eigen::Dynamic, 1> sum = Eigen::Matrix<T, Eigen::Dynamic, 1>::Zero(width);
        for (std::size_t e = row * k; e < (row + 1) * k; ++e)
          for (int s = 0; s < op_.op.sides; ++s) {
            const Vector3<T> d = difference_gradient(slots, e, s);
            sum.template segment<3>(3 * s) += d;
            Eigen::Map<Vector3<T>>(starts.data() + e * width + 3 * s) = -d;
          }
        if (const Slot* to = slots.grad_input(0))
          Eigen::Map<Eigen::Matrix<T, Eigen::Dynamic, 1>>(to->as<T>() + row * width, width) = sum;
      }
    });
    if (const Slot* to = slots.grad_input(1)) scatter_to_neighbors(args, index, starts.data(), *to);
  }

 private:
  // Zero for an edge of length zero, which has no direction.
  Vector3<T> difference_gradient(const GradientSlots<ops::EdgeGeometry>& slots, std::size_t e, int s) const {
    const std::size_t at = e * op_.op.sides + s;
    const T length = slots.out(0).template as<T>()[at];
    if (!(length > 0)) return Vector3<T>::Zero();
    const auto xyz = [&](const Slot& slot) {
      const T* yzx = slot.as<T>() + 3 * at;
      return Vector3<T>(yzx[2], yzx[0], yzx[1]);
    };
    const Vector3<T> unit = xyz(slots.out(1));
    Vector3<T> gradient = Vector3<T>::Zero();
    if (const Slot* grad_output = slots.grad_output(0)) gradient += grad_output->as<T>()[at] * unit;
    if (const Slot* grad_output = slots.grad_output(1)) {
      const Vector3<T> turn = xyz(*grad_output);
      gradient += (turn - turn.dot(unit) * unit) / std::max(length, static_cast<T>(ops::direction_eps));
    }
    return gradient;
  }

  const ops::Gradient<ops::EdgeGeometry> op_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::Gradient<ops::EdgeGeometry>& op) {
  return std::make_unique<EdgeGeometryGradient<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::Gradient<ops::EdgeGeometry>& op) {
  return std::make_unique<EdgeGeometryGradient<double>>(op);
}

}  // namespace bitr::cpu
