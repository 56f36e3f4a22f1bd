#include "loss.spv.hpp"

#include <algorithm>

#include "core/failure.hpp"
#include "loss_gradient.spv.hpp"
#include "vk/kernel.hpp"

namespace bitr::vk {
namespace {

constexpr std::uint32_t loss_group = 128;
constexpr std::uint32_t most_keys = 1024;  // the shaders' loops go over their pairs

std::uint32_t checked_keys(const graph::BatchLayout& layout) {
  if (layout.key_points > most_keys)
    throw Failure(ErrorCode::unsupported, "the loss of " + std::to_string(layout.key_points) +
                                              " key points; Vulkan takes up to " + std::to_string(most_keys));
  return layout.key_points;
}

class LossKernel : public Kernel {
 public:
  LossKernel(const KernelContext& site, const ops::Loss& op)
      : capabilities_(site.context.capabilities()),
        pipeline_(site.context.pipeline(shaders::loss,
                                        std::array{loss_group, static_cast<std::uint32_t>(op.kind)})) {}

  void record(const Arguments& args) const override {
    const std::uint32_t pairs = args.layout.pairs(), keys = checked_keys(args.layout);
    for (std::uint32_t first = 0; first < pairs; first += capabilities_.groups) {
      const std::uint32_t count = std::min(pairs - first, capabilities_.groups);
      args.schedule.dispatch(pipeline_,
                             {args.in[0].range, args.in[1].range, args.in[2].range, args.out[0].range},
                             KeyParameters{first, pairs, keys}, {count, 1, 1}, 20.0 * count * keys * keys);
    }
  }

 private:
  const Capabilities& capabilities_;
  PipelineOf<KeyParameters> pipeline_;
};

class LossGradient : public Kernel {
 public:
  LossGradient(const KernelContext& site, const ops::Gradient<ops::Loss>& op)
      : op_(op),
        capabilities_(site.context.capabilities()),
        pipeline_(site.context.pipeline(shaders::loss_gradient,
                                        std::array{tile_rows, static_cast<std::uint32_t>(op.op.kind),
                                                   std::uint32_t{op.grad_input_at(estimate_input) >= 0},
                                                   std::uint32_t{op.grad_input_at(keys_input) >= 0}})) {
    if (op.grad_input_at(truth_input) >= 0)
      throw Failure(ErrorCode::internal, "the loss's gradient with respect to the truth");
  }

  std::size_t scratch_bytes(const graph::BatchLayout&) const override { return 4 * sizeof(float); }

  void record(const Arguments& args) const override {
    const GradientSlots<ops::Loss> slots{op_, args};
    const std::uint32_t clouds = args.layout.clouds(), keys = checked_keys(args.layout);
    for (std::uint32_t first = 0; first < clouds; first += capabilities_.groups) {
      const std::uint32_t count = std::min(clouds - first, capabilities_.groups);
      args.schedule.dispatch(pipeline_,
                             {slots.in(estimate_input), slots.in(truth_input), slots.in(keys_input),
                              slots.grad_input(estimate_input), slots.grad_input(keys_input)},
                             KeyParameters{first, args.layout.pairs(), keys}, {count, 1, 1},
                             20.0 * count * keys * keys);
    }
  }

 private:
  enum : int { estimate_input, truth_input, keys_input };
  const ops::Gradient<ops::Loss> op_;
  const Capabilities& capabilities_;
  PipelineOf<KeyParameters> pipeline_;
};

}  // namespace

template <>
KernelPtr make_kernel(const KernelContext& site, const ops::Loss& op) {
  return std::make_unique<LossKernel>(site, op);
}
template <>
KernelPtr make_kernel(const KernelContext& site, const ops::Gradient<ops::Loss>& op) {
  return std::make_unique<LossGradient>(site, op);
}

}  // namespace bitr::vk
