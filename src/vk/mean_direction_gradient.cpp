#include "core/failure.hpp"
#include "vk/point_attention_gradient.hpp"

namespace bitr::vk {

template <>
KernelPtr make_kernel(const KernelContext& site, const ops::Gradient<ops::MeanDirection>& op) {
  if (!op.needs_input_grad.empty())
    throw Failure(ErrorCode::unsupported, "gradients with respect to points run on the CPU only");
  return make_point_gradient(site, op.op.general,
                             {.index = 1,
                              .centres = 0,
                              .neighbors = 0,
                              .grad_output = op.grad_output_at(0),
                              .d_constants = op.constants_at(),
                              .constant = op.op.constant});
}

}  // namespace bitr::vk
