#include "head.spv.hpp"

#include <algorithm>

#include "core/failure.hpp"
#include "vk/kernel.hpp"

namespace bitr::vk {
namespace {

constexpr std::uint32_t head_group = 128;
constexpr std::uint32_t head_numbers = 4080;

class HeadKernel : public Kernel {
 public:
  HeadKernel(const KernelContext& site, const ops::Head& op)
      : capabilities_(site.context.capabilities()),
        scalars_(channels(op, {0, 0})),
        vectors_(channels(op, {1, 0})),
        matrices_(channels(op, {1, 1})),
        pipeline_(
            site.context.pipeline(shaders::head, std::array{head_group, scalars_, vectors_, matrices_})) {
    add_constants(op.norm_weight);
    add_constants(op.norm_bias);
    add_constants((1 - op.mean_scale.array()).matrix());
    add_constants(op.logit_weight);
    add_constants(op.logit_bias);
    add_constants(op.vector_mix);
    add_constants(op.matrix_mix);
    add_constant(op.eps);
  }

  void record(const Arguments& args) const override {
    const std::uint32_t keys = args.layout.key_points, pairs = args.layout.pairs();
    if (3 * keys + std::max(3 * scalars_, 6 * vectors_ + 9 * matrices_ + 6) > head_numbers)
      throw Failure(ErrorCode::unsupported, "the head has too many key points or channels for Vulkan");
    const double cost = keys * (12.0 * scalars_ + 12.0 * vectors_ + 18.0 * matrices_);
    for (std::uint32_t first = 0; first < pairs; first += capabilities_.groups) {
      const std::uint32_t count = std::min(pairs - first, capabilities_.groups);
      args.schedule.dispatch(pipeline_,
                             {args.in[0].range, args.in[1].range, args.constants, args.out[0].range,
                              args.out[1].range, args.out[2].range, args.out[3].range},
                             HeadParameters{first, keys}, {count, 1, 1}, cost * count);
    }
  }

 private:
  static std::uint32_t channels(const ops::Head& op, irreps::Degree degree) {
    return static_cast<std::uint32_t>(op.fiber.channels(degree));
  }

  const Capabilities& capabilities_;
  const std::uint32_t scalars_, vectors_, matrices_;
  PipelineOf<HeadParameters> pipeline_;
};

}  // namespace

template <>
KernelPtr make_kernel(const KernelContext& site, const ops::Head& op) {
  return std::make_unique<HeadKernel>(site, op);
}

}  // namespace bitr::vk
