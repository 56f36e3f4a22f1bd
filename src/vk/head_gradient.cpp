#include "head_gradient.spv.hpp"

#include <algorithm>

#include "core/failure.hpp"
#include "vk/kernel.hpp"
#include "vk/row_sums.hpp"

namespace bitr::vk {
namespace {

constexpr std::uint32_t head_gradient_group = 128;
constexpr std::uint32_t head_gradient_numbers = 4064;

enum : int { positions_input, features_input };
enum : int { normed_output, logits_output, weights_output, pieces_output };

class HeadGradient : public Kernel {
 public:
  HeadGradient(const KernelContext& site, const ops::Gradient<ops::Head>& op)
      : op_(op),
        capabilities_(site.context.capabilities()),
        scalars_(channels({0, 0})),
        vectors_(channels({1, 0})),
        matrices_(channels({1, 1})),
        pipeline_(site.context.pipeline(shaders::head_gradient,
                                        std::array{head_gradient_group, scalars_, vectors_, matrices_,
                                                   std::uint32_t{op.grad_input_at(positions_input) >= 0},
                                                   std::uint32_t{op.grad_input_at(features_input) >= 0}})),
        sums_(site.context) {
    if (op.grad_outputs != std::vector<int>{pieces_output} || !op.constants)
      throw Failure(ErrorCode::unsupported, "Vulkan takes the head's gradient with respect to its pieces");
    const ops::Head& head = op.op;
    add_constants(head.norm_weight);
    add_constants(head.norm_bias);
    add_constants((1 - head.mean_scale.array()).matrix());
    add_constants(head.logit_weight);
    add_constants(head.logit_bias);
    add_constants(head.vector_mix);
    add_constants(head.matrix_mix);
    count_ = constants().size();
    add_constant(head.eps);
  }

  // The pairs' shares of the constants' gradient.
  std::size_t scratch_bytes(const graph::BatchLayout& layout) const override {
    return layout.pairs() * padded(static_cast<int>(count_)) * sizeof(float);
  }

  void record(const Arguments& args) const override {
    const GradientSlots<ops::Head> slots{op_, args};
    const std::uint32_t keys = args.layout.key_points, pairs = args.layout.pairs();
    if (3 * keys + 4 * scalars_ > head_gradient_numbers)
      throw Failure(ErrorCode::unsupported, "the head has too many key points or channels for Vulkan");
    const double cost = keys * (20.0 * scalars_ + 24.0 * vectors_ + 36.0 * matrices_);
    for (std::uint32_t first = 0; first < pairs; first += capabilities_.groups) {
      const std::uint32_t count = std::min(pairs - first, capabilities_.groups);
      args.schedule.dispatch(
          pipeline_,
          {slots.in(positions_input), slots.in(features_input), slots.out(weights_output),
           slots.grad_output(pieces_output), args.constants, slots.grad_input(positions_input),
           slots.grad_input(features_input), args.scratch},
          HeadParameters{first, keys}, {count, 1, 1}, cost * count);
    }
    sums_.record(args.schedule, args.scratch, pairs, slots.constants());
  }

 private:
  std::uint32_t channels(irreps::Degree degree) const {
    return static_cast<std::uint32_t>(op_.op.fiber.channels(degree));
  }

  const ops::Gradient<ops::Head> op_;
  const Capabilities& capabilities_;
  const std::uint32_t scalars_, vectors_, matrices_;
  PipelineOf<HeadParameters> pipeline_;
  const RowSums sums_;
  std::size_t count_ = 0;
};

}  // namespace

template <>
KernelPtr make_kernel(const KernelContext& site, const ops::Gradient<ops::Head>& op) {
  return std::make_unique<HeadGradient>(site, op);
}

}  // namespace bitr::vk
