#include "input_features.spv.hpp"
#include "vk/kernel.hpp"

namespace bitr::vk {
namespace {

constexpr Access bindings[] = {Access::read, Access::read, Access::read, Access::write};
constexpr Shader shader{"input_features", spirv::input_features, bindings, sizeof(TileParameters), 3};

class InputFeaturesKernel : public Kernel {
 public:
  InputFeaturesKernel(const Site& site, const ops::InputFeatures& op)
      : op_(op),
        capabilities_(site.context.capabilities()),
        pipeline_(site.context.pipeline(shader, std::array{tile_rows, static_cast<std::uint32_t>(op.colors),
                                                           static_cast<std::uint32_t>(op.normals)})) {
    add_constant(ops::constant_feature);
    pad_constants(4);
  }

  void record(const Arguments& args) const override {
    const Range colors = op_.colors ? args.in.front().range : args.constants;
    const Range normals = op_.normals ? args.in.back().range : args.constants;
    for (const TileRun& run : tile_runs(args.tables.point, capabilities_, 1))
      args.schedule.dispatch(pipeline_, {colors, normals, args.tables.point.tiles, args.out[0].range},
                             TileParameters{run.first}, {run.count, 1, 1}, run.end_row - run.first_row);
  }

 private:
  const ops::InputFeatures op_;
  const Capabilities& capabilities_;
  const Pipeline& pipeline_;
};

}  // namespace

KernelPtr make_kernel(const Site& site, const ops::InputFeatures& op) {
  return std::make_unique<InputFeaturesKernel>(site, op);
}

}  // namespace bitr::vk
