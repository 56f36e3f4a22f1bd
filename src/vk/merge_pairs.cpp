#include <algorithm>

#include "merge_pairs.spv.hpp"
#include "vk/kernel.hpp"

namespace bitr::vk {
namespace {

class MergePairsKernel : public Kernel {
 public:
  MergePairsKernel(const KernelContext& site, const ops::MergePairs& op)
      : width_(static_cast<std::uint32_t>(op.merged().size())),
        most_groups_(site.context.capabilities().groups),
        pipeline_(site.context.pipeline(shaders::merge_pairs,
                                        std::array{tile_rows, static_cast<std::uint32_t>(op.channels)})) {}

  void record(const Arguments& args) const override {
    const std::uint32_t nodes = args.layout.pairs() * args.layout.key_points;
    const std::uint32_t groups = (nodes * width_ + tile_rows - 1) / tile_rows;
    for (std::uint32_t first = 0; first < groups; first += most_groups_) {
      const std::uint32_t count = std::min(most_groups_, groups - first);
      args.schedule.dispatch(pipeline_,
                             {args.in[0].range, args.in[1].range, args.out[0].range, args.out[1].range},
                             MergeParameters{first * tile_rows, nodes}, {count, 1, 1}, count * tile_rows);
    }
  }

 private:
  const std::uint32_t width_;
  const std::uint32_t most_groups_;
  PipelineOf<MergeParameters> pipeline_;
};

}  // namespace

template <>
KernelPtr make_kernel(const KernelContext& site, const ops::MergePairs& op) {
  return std::make_unique<MergePairsKernel>(site, op);
}

}  // namespace bitr::vk
