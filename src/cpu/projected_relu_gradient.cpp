#include "cpu/projected_relu_gradient.hpp"

#include "cpu/constant_gradient.hpp"

namespace bitr::cpu {
namespace {

template <class T>
class ProjectedReluGradient : public Kernel<T> {
 public:
  explicit ProjectedReluGradient(const ops::Gradient<ops::ProjectedRelu>& op) : op_(op) {
    for (const auto& [d, plane] : op.op.planes) planes_[d] = plane;
  }

  void run(const Arguments& args) const override {
    const GradientSlots<ops::ProjectedRelu> slots{op_, args};
    const auto body = [&](std::size_t begin, std::size_t end, ops::ProjectedRelu& constants) {
      for (std::size_t row = begin; row < end; ++row) run_row(slots, row, constants);
    };
    ops::ProjectedRelu constants = sum_constants(args, op_.op, args.rows(slots.in(0)), 256, body);
    store_constants<T>(slots.constants(), constants);
  }

 private:
  void run_row(const GradientSlots<ops::ProjectedRelu>& slots, std::size_t row,
               ops::ProjectedRelu& constants) const {
    const auto width = static_cast<Eigen::Index>(slots.in(0).stride());
    const auto load = [&](const Slot& slot) -> Eigen::VectorXd {
      return Eigen::Map<const Eigen::Matrix<T, Eigen::Dynamic, 1>>(slot.as<T>() + row * width, width)
          .template cast<double>();
    };
    const Eigen::VectorXd x = load(slots.in(0));
    Eigen::VectorXd d = slots.grad_output(0) ? load(*slots.grad_output(0)) : Eigen::VectorXd::Zero(width);
    for (int c = 0; c < op_.op.fiber.channels({0, 0}); ++c)
      if (!(x[c] > 0)) d[c] *= ops::leaky_slope;
    for (const auto& [degree, plane] : planes_) {
      const int at = op_.op.fiber.offset(degree);
      projected_relu_gradient(plane, op_.op.square, degree.dim(), x.data() + at, d.data() + at,
                              constants.planes.at(degree).data());
    }
    if (const Slot* to = slots.grad_input(0))
      Eigen::Map<Eigen::Matrix<T, Eigen::Dynamic, 1>>(to->as<T>() + row * width, width) =
          d.template cast<T>();
  }

  const ops::Gradient<ops::ProjectedRelu> op_;
  std::map<irreps::Degree, RowMatrix<double>> planes_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::Gradient<ops::ProjectedRelu>& op) {
  return std::make_unique<ProjectedReluGradient<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::Gradient<ops::ProjectedRelu>& op) {
  return std::make_unique<ProjectedReluGradient<double>>(op);
}

}  // namespace bitr::cpu
