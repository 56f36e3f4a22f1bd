#include "mean_direction.spv.hpp"
#include "vk/kernel.hpp"

namespace bitr::vk {
namespace {

class MeanDirectionKernel : public Kernel {
 public:
  MeanDirectionKernel(const KernelContext& site, const ops::MeanDirection& op)
      : capabilities_(site.context.capabilities()) {
    const ops::PointAttention& layer = op.general;
    const double c = op.constant;
    const auto affine = [c](const auto& row) { return row[0] * c + row[1]; };
    add_constants(layer.S0.col(0) * c + layer.S0.col(1));
    add_constants(layer.plane);
    for (int h = 0; h < layer.heads; ++h) {
      add_constant(affine(layer.M0.row(h)) * c);
      add_constant(affine(layer.Mz0.row(2 * h)) * c + affine(layer.Mz0.row(2 * h + 1)));
      add_constants(layer.O0.col(h) * c);
      add_constants(layer.Oz0.col(2 * h) * c + layer.Oz0.col(2 * h + 1));
      if (layer.m1 > 0) add_constants(layer.O1.col(h) * c);
    }
    pad_constants(4);
    pipeline_ = site.context.pipeline(shaders::mean_direction,
                                      std::array{tile_rows, number(site.in[1].per_row), number(layer.m0),
                                                 number(layer.m1), number(layer.heads), number(layer.relu),
                                                 number(constants().size() / 4), number(layer.relu_square)});
  }

  void record(const Arguments& args) const override {
    const Slot &index = args.in[1], &result = args.out[0];
    const RowTable& table = args.tables.of(result.rows);
    const double cost = 20.0 * index.per_row;
    for (const TileRun& run : tile_runs(table, capabilities_, cost,
                                        sizeof(std::uint32_t) * static_cast<std::size_t>(index.per_row)))
      args.schedule.dispatch(
          pipeline_, {args.in[0].range, rows_of(index, run), table.tiles, result.range, args.constants},
          PointParameters{run.first, run.first_row}, {run.count, 1, 1}, cost * (run.end_row - run.first_row));
  }

 private:
  const Capabilities& capabilities_;
  PipelineOf<PointParameters> pipeline_;
};

}  // namespace

template <>
KernelPtr make_kernel(const KernelContext& site, const ops::MeanDirection& op) {
  return std::make_unique<MeanDirectionKernel>(site, op);
}

}  // namespace bitr::vk
