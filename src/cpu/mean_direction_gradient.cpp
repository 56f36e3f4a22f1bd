#include "core/failure.hpp"
#include "cpu/point_attention_gradient.hpp"

namespace bitr::cpu {
namespace {

// The layer is `general` on the constant feature, and so is its gradient.
template <class T>
class MeanDirectionGradient : public Kernel<T> {
 public:
  explicit MeanDirectionGradient(const ops::Gradient<ops::MeanDirection>& op)
      : op_(op), constant_(static_cast<T>(op.op.constant)) {
    if (!op.needs_input_grad.empty())
      throw Failure(ErrorCode::unsupported, "no gradient of mean_direction with respect to positions");
  }

  void run(const Arguments& args) const override {
    const GradientSlots<ops::MeanDirection> slots{op_, args};
    const Slot& edges = slots.in(1);
    const T* positions = slots.in(0).as<T>();
    PointGradients<T> out;
    out.constants = slots.constants();
    point_attention_gradient<T>(args, op_.op.general, edges.rows, edges.per_row,
                                {&constant_, 0, edges.as<std::uint32_t>(), positions, positions, nullptr},
                                slots.grad_output(0)->as<T>(), nullptr, out);
  }

 private:
  const ops::Gradient<ops::MeanDirection> op_;
  const T constant_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::Gradient<ops::MeanDirection>& op) {
  return std::make_unique<MeanDirectionGradient<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::Gradient<ops::MeanDirection>& op) {
  return std::make_unique<MeanDirectionGradient<double>>(op);
}

}  // namespace bitr::cpu
