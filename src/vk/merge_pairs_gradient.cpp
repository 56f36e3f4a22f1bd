#include "merge_pairs_gradient.spv.hpp"

#include <algorithm>

#include "vk/kernel.hpp"

namespace bitr::vk {
namespace {

class MergePairsGradient : public Kernel {
 public:
  MergePairsGradient(const KernelContext& site, const ops::Gradient<ops::MergePairs>& op)
      : op_(op),
        most_groups_(site.context.capabilities().groups),
        pipeline_(site.context.pipeline(
            shaders::merge_pairs_gradient,
            std::array{tile_rows, static_cast<std::uint32_t>(op.op.channels),
                       std::uint32_t{op.grad_output_at(0) >= 0}, std::uint32_t{op.grad_output_at(1) >= 0},
                       std::uint32_t{op.grad_input_at(0) >= 0}, std::uint32_t{op.grad_input_at(1) >= 0}})) {}

  std::size_t scratch_bytes(const graph::BatchLayout&) const override { return 4 * sizeof(float); }

  void record(const Arguments& args) const override {
    const GradientSlots<ops::MergePairs> slots{op_, args};
    const std::uint32_t nodes = args.layout.pairs() * args.layout.key_points;
    const std::uint32_t items = 2 * nodes * (4 * static_cast<std::uint32_t>(op_.op.channels) + 4);
    const std::uint32_t groups = (items + tile_rows - 1) / tile_rows;
    for (std::uint32_t first = 0; first < groups; first += most_groups_) {
      const std::uint32_t count = std::min(most_groups_, groups - first);
      args.schedule.dispatch(
          pipeline_,
          {slots.in(1), slots.grad_output(0), slots.grad_output(1), slots.grad_input(0), slots.grad_input(1)},
          MergeParameters{first * tile_rows, nodes}, {count, 1, 1}, 8.0 * count * tile_rows);
    }
  }

 private:
  const ops::Gradient<ops::MergePairs> op_;
  const std::uint32_t most_groups_;
  PipelineOf<MergeParameters> pipeline_;
};

}  // namespace

template <>
KernelPtr make_kernel(const KernelContext& site, const ops::Gradient<ops::MergePairs>& op) {
  return std::make_unique<MergePairsGradient>(site, op);
}

}  // namespace bitr::vk
