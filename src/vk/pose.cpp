#include "pose.spv.hpp"
#include "vk/kernel.hpp"

namespace bitr::vk {
namespace {

class ProjectPoseKernel : public Kernel {
 public:
  explicit ProjectPoseKernel(const KernelContext& site)
      : pipeline_(site.context.pipeline(shaders::pose, std::array{tile_rows})) {}

  void record(const Arguments& args) const override {
    const std::uint32_t pairs = args.layout.pairs();
    args.schedule.dispatch(pipeline_, {args.in[0].range, args.out[0].range}, SegmentParameters{0, pairs},
                           {(pairs + tile_rows - 1) / tile_rows, 1, 1}, 2000.0 * pairs);
  }

 private:
  PipelineOf<SegmentParameters> pipeline_;
};

}  // namespace

template <>
KernelPtr make_kernel(const KernelContext& site, const ops::ProjectPose&) {
  return std::make_unique<ProjectPoseKernel>(site);
}

}  // namespace bitr::vk
