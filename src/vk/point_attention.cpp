#include <algorithm>

#include "core/failure.hpp"
#include "point_attention.spv.hpp"
#include "point_attention_texels.spv.hpp"
#include "vk/point_attention_gradient.hpp"
#include "vk/point_flags.hpp"

namespace bitr::vk {
namespace {

// Bytes of sums saved for the gradient, which makes them again where there are more.
constexpr std::size_t most_point_saved = std::size_t{64} << 20;

class PointAttentionKernel : public Kernel {
 public:
  PointAttentionKernel(const KernelContext& site, const ops::PointAttention& op)
      : op_(op),
        capabilities_(site.context.capabilities()),
        row_bytes_(sizeof(float) * padded(site.out[0].width)),
        rows_(site.out[0].rows),
        saves_(site.saved && saved_row_bytes(op) * site.largest.rows(rows_) <= most_point_saved) {
    for (const auto* matrix : {&op.M1, &op.O1, &op.S1, &op.Mz1, &op.Oz1, &op.plane}) add_constants(*matrix);
    pad_constants(4);
    if (!op.per_cloud)
      for (const auto* matrix : {&op.M0, &op.O0, &op.S0, &op.Mz0, &op.Oz0}) add_constants(*matrix);
    if (constants().empty()) add_constant(0.0);
    pad_constants(4);
    pipeline_ = site.context.pipeline(
        capabilities_.texels ? shaders::point_attention_texels : shaders::point_attention,
        specializations(site));
  }

  std::size_t saved_bytes(const graph::BatchLayout& layout) const override {
    return saves_ ? saved_row_bytes(op_) * layout.rows(rows_) : 0;
  }

  void record(const Arguments& args) const override {
    const Slot &features = args.in[0], &index = args.in[1], &result = args.out[0];
    const RowTable& table = args.tables.of(result.rows);
    // Products and sums of φ, per edge and head.
    const double cost = index.per_row * (10.0 + op_.heads) * (op_.n0() + 3 * op_.n1());
    for (const TileRun& run :
         tile_runs(table, capabilities_, cost,
                   std::max(row_bytes_, sizeof(std::uint32_t) * static_cast<std::size_t>(index.per_row)))) {
      const Range rows = rows_of(result.range, row_bytes_, run);
      args.schedule.dispatch(pipeline_,
                             {features.range, rows_of(index, run), args.in[2].range, args.in[3].range,
                              op_.per_cloud ? args.in[4].range : features.range, table.tiles, rows,
                              args.constants, saves_ ? args.saved : rows},
                             PointParameters{run.first, run.first_row}, {run.count, 1, 1},
                             cost * (run.end_row - run.first_row));
    }
  }

 private:
  std::array<std::uint32_t, 9> specializations(const KernelContext& site) const {
    const ops::PointAttention& op = op_;
    return {tile_rows,
            number(site.in[1].per_row),
            number(op.c0),
            number(op.c1),
            number(op.m0),
            number(op.m1),
            number(op.heads),
            point_flags(op) | (saves_ ? POINT_KEEP : 0),
            static_cast<std::uint32_t>(constants().size() / 4)};
  }

  const ops::PointAttention op_;
  PipelineOf<PointParameters> pipeline_;
  const Capabilities& capabilities_;
  const std::size_t row_bytes_;  // bytes of a row of the result
  const graph::Rows rows_;
  const bool saves_;  // its sums, for the gradient
};

}  // namespace

template <>
KernelPtr make_kernel(const KernelContext& site, const ops::PointAttention& op) {
  return std::make_unique<PointAttentionKernel>(site, op);
}

}  // namespace bitr::vk
