#include "core/failure.hpp"
#include "pose_gradient.spv.hpp"
#include "vk/kernel.hpp"

namespace bitr::vk {
namespace {

class ProjectPoseGradient : public Kernel {
 public:
  ProjectPoseGradient(const KernelContext& site, const ops::Gradient<ops::ProjectPose>& op)
      : op_(op), pipeline_(site.context.pipeline(shaders::pose_gradient, std::array{tile_rows})) {
    if (op.grad_output_at(0) < 0 || op.grad_input_at(0) < 0)
      throw Failure(ErrorCode::internal, "a pose's gradient that nothing needs");
  }

  void record(const Arguments& args) const override {
    const GradientSlots<ops::ProjectPose> slots{op_, args};
    const std::uint32_t pairs = args.layout.pairs();
    args.schedule.dispatch(pipeline_, {slots.in(0), slots.out(0), slots.grad_output(0), slots.grad_input(0)},
                           SegmentParameters{0, pairs}, {(pairs + tile_rows - 1) / tile_rows, 1, 1},
                           500.0 * pairs);
  }

 private:
  const ops::Gradient<ops::ProjectPose> op_;
  PipelineOf<SegmentParameters> pipeline_;
};

}  // namespace

template <>
KernelPtr make_kernel(const KernelContext& site, const ops::Gradient<ops::ProjectPose>& op) {
  return std::make_unique<ProjectPoseGradient>(site, op);
}

}  // namespace bitr::vk
