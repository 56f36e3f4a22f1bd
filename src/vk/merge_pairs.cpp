#include "merge_pairs.spv.hpp"
#include "vk/kernel.hpp"

namespace bitr::vk {
namespace {

constexpr Access bindings[] = {Access::read, Access::read, Access::write, Access::write};
constexpr Shader shader{"merge_pairs", spirv::merge_pairs, bindings, sizeof(NodeParameters), 2};

class MergePairsKernel : public Kernel {
 public:
  MergePairsKernel(const Site& site, const ops::MergePairs& op)
      : width_(static_cast<std::uint32_t>(op.merged().size())),
        pipeline_(
            site.context.pipeline(shader, std::array{tile_rows, static_cast<std::uint32_t>(op.channels)})) {}

  void record(const Arguments& args) const override {
    const std::uint32_t nodes = args.layout.pairs() * args.layout.key_points;
    args.schedule.dispatch(pipeline_,
                           {args.in[0].range, args.in[1].range, args.out[0].range, args.out[1].range},
                           NodeParameters{nodes, args.layout.key_points},
                           {(nodes * width_ + tile_rows - 1) / tile_rows, 1, 1}, nodes * width_);
  }

 private:
  const std::uint32_t width_;
  const Pipeline& pipeline_;
};

}  // namespace

KernelPtr make_kernel(const Site& site, const ops::MergePairs& op) {
  return std::make_unique<MergePairsKernel>(site, op);
}

}  // namespace bitr::vk
