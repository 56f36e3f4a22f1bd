#include "input_features.spv.hpp"
#include "vk/kernel.hpp"

namespace bitr::vk {
namespace {

class InputFeaturesKernel : public Kernel {
 public:
  InputFeaturesKernel(const KernelContext& site, const ops::InputFeatures& op)
      : op_(op),
        capabilities_(site.context.capabilities()),
        pipeline_(site.context.pipeline(
            shaders::input_features,
            std::array{tile_rows, static_cast<std::uint32_t>(op.colors),
                       static_cast<std::uint32_t>(op.normals), static_cast<std::uint32_t>(op.offsets)})) {
    add_constant(ops::constant_feature);
    pad_constants(4);
  }

  void record(const Arguments& args) const override {
    std::size_t next = 0;
    const auto attribute = [&](bool used) { return used ? args.in[next++].range : args.constants; };
    const Range colors = attribute(op_.colors), normals = attribute(op_.normals),
                offsets = attribute(op_.offsets);
    for (const TileRun& run : tile_runs(args.tables.point, capabilities_, 1))
      args.schedule.dispatch(pipeline_,
                             {colors, normals, offsets, args.tables.point.tiles, args.out[0].range},
                             TileParameters{run.first}, {run.count, 1, 1}, run.end_row - run.first_row);
  }

 private:
  const ops::InputFeatures op_;
  const Capabilities& capabilities_;
  PipelineOf<TileParameters> pipeline_;
};

}  // namespace

template <>
KernelPtr make_kernel(const KernelContext& site, const ops::InputFeatures& op) {
  return std::make_unique<InputFeaturesKernel>(site, op);
}

}  // namespace bitr::vk
