#include "cpu/constant_gradient.hpp"

namespace bitr::cpu {
namespace {

// One input's share of one degree.
struct Part {
  irreps::Degree degree;
  int input, column, in_offset, out_offset;
  RowMatrix<double> weights;  // channels out × channels in, the skip included
};

template <class T>
class LinearGradient : public Kernel<T> {
 public:
  explicit LinearGradient(const ops::Gradient<ops::Linear>& op) : op_(op) {
    for (const auto& [d, matrix] : op.op.weights) {
      int column = 0;
      for (int i = 0; i < op.inputs; ++i) {
        const irreps::Fiber& fiber = op.op.fiber_in[i];
        const int channels = fiber.channels(d);
        if (channels == 0) continue;
        RowMatrix<double> weights = matrix.middleCols(column, channels);
        if (op.op.skip.count(d))
          for (int c = 0; c < channels; ++c) weights(column + c, c) += 1;
        parts_.push_back({d, i, column, fiber.offset(d), op.op.fiber_out.offset(d), std::move(weights)});
        column += channels;
      }
    }
  }

  void run(const Arguments& args) const override {
    const GradientSlots<ops::Linear> slots{op_, args};
    const auto body = [&](std::size_t begin, std::size_t end, ops::Linear& constants) {
      for (std::size_t row = begin; row < end; ++row) run_row(slots, row, constants);
    };
    ops::Linear constants = sum_constants(args, op_.op, args.rows(slots.out(0)), 256, body);
    store_constants<T>(slots.constants(), constants);
  }

 private:
  static auto map(const Slot& slot, std::size_t row, int offset, Eigen::Index channels, int dim) {
    return Eigen::Map<RowMatrix<T>>(slot.as<T>() + row * slot.stride() + offset, channels, dim);
  }

  void run_row(const GradientSlots<ops::Linear>& slots, std::size_t row, ops::Linear& constants) const {
    for (int i = 0; i < op_.inputs; ++i)
      if (const Slot* to = slots.grad_input(i))
        std::fill_n(to->as<T>() + row * to->stride(), to->stride(), T{0});
    const Slot* grad_output = slots.grad_output(0);
    if (!grad_output) return;
    for (const Part& part : parts_) {
      const int dim = part.degree.dim();
      const Eigen::Index channels = part.weights.cols();
      const RowMatrix<double> out =
          map(*grad_output, row, part.out_offset, part.weights.rows(), dim).template cast<double>();
      const RowMatrix<double> in =
          map(slots.in(part.input), row, part.in_offset, channels, dim).template cast<double>();
      constants.weights.at(part.degree).middleCols(part.column, channels) += out.lazyProduct(in.transpose());
      if (const Slot* to = slots.grad_input(part.input))
        map(*to, row, part.in_offset, channels, dim) =
            part.weights.transpose().lazyProduct(out).template cast<T>();
    }
  }

  const ops::Gradient<ops::Linear> op_;
  std::vector<Part> parts_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::Gradient<ops::Linear>& op) {
  return std::make_unique<LinearGradient<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::Gradient<ops::Linear>& op) {
  return std::make_unique<LinearGradient<double>>(op);
}

}  // namespace bitr::cpu
