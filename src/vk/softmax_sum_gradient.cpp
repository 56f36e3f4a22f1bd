#include "softmax_sum_gradient.spv.hpp"

#include <algorithm>

#include "core/failure.hpp"
#include "softmax_normaliser.spv.hpp"
#include "vk/kernel.hpp"

namespace bitr::vk {
namespace {

constexpr std::uint32_t sum_gradient_group = 128;
constexpr int most_channels = 1024, most_columns = 256;  // the shader's limits

// FLAGS of the shader.
constexpr std::uint32_t logits = 1, more = 2, values = 4, grad_output = 8;

class SoftmaxSumGradient : public Kernel {
 public:
  SoftmaxSumGradient(const KernelContext& site, const ops::Gradient<ops::SoftmaxSum>& op)
      : op_(op), capabilities_(site.context.capabilities()), stride_(padded(site.in[0].width)) {
    normaliser_ = site.context.pipeline(shaders::softmax_normaliser, std::array{sum_gradient_group, stride_});
    std::uint32_t added = 0;
    for (int i = 0; i < op.outputs; ++i) {
      const int columns = site.in[op.inputs + i].width;
      if (op.op.channels > most_channels || columns > most_columns)
        throw Failure(ErrorCode::unsupported,
                      "the gradient of " + std::to_string(op.op.channels) + " softmaxes over " +
                          std::to_string(columns) + " columns; Vulkan takes up to " +
                          std::to_string(most_channels) + " and " + std::to_string(most_columns));
      std::uint32_t flags = op.grad_output_at(i) >= 0 ? grad_output : 0;
      if (op.grad_input_at(0) >= 0 && op.grad_output_at(i) >= 0) flags |= logits | added;
      if (op.grad_input_at(i + 1) >= 0) flags |= values;
      if (flags & logits) added = more;
      columns_.push_back(columns);
      pipelines_.push_back(
          (flags & (logits | values)) == 0
              ? PipelineOf<TileParameters>{}
              : site.context.pipeline(
                    shaders::softmax_sum_gradient,
                    std::array{tile_rows, number(op.op.channels), stride_, padded(site.in[i + 1].width),
                               number(op.op.skip[i]), number(columns), flags}));
    }
  }

  std::size_t scratch_bytes(const graph::BatchLayout& layout) const override {
    return 2 * sizeof(float) * stride_ * layout.clouds();
  }

  void record(const Arguments& args) const override {
    const GradientSlots<ops::SoftmaxSum> slots{op_, args};
    const RowTable& points = args.tables.point;
    const std::uint32_t clouds = args.layout.clouds();
    for (std::uint32_t first = 0; first < clouds; first += capabilities_.groups)
      args.schedule.dispatch(normaliser_, {slots.in(0), points.offsets, args.scratch},
                             SegmentParameters{first, clouds},
                             {stride_ / 4, std::min(clouds - first, capabilities_.groups), 1},
                             20.0 * stride_ * static_cast<double>(args.layout.rows(graph::Rows::point)));
    for (int i = 0; i < op_.outputs; ++i) {
      if (!pipelines_[i]) continue;
      const double cost = op_.op.channels * (20.0 + 8.0 * columns_[i]);
      for (const TileRun& run : tile_runs(points, capabilities_, cost))
        args.schedule.dispatch(pipelines_[i],
                               {slots.in(0), args.scratch, points.tiles, slots.in(i + 1), slots.out(i),
                                slots.grad_output(i), slots.grad_input(0), slots.grad_input(i + 1)},
                               TileParameters{run.first}, {run.count, 1, 1},
                               cost * (run.end_row - run.first_row));
    }
  }

 private:
  const ops::Gradient<ops::SoftmaxSum> op_;
  const Capabilities& capabilities_;
  const std::uint32_t stride_;  // numbers of a row of logits
  PipelineOf<SegmentParameters> normaliser_;
  std::vector<int> columns_;
  std::vector<PipelineOf<TileParameters>> pipelines_;  // per values tensor; null: nothing to do
};

}  // namespace

template <>
KernelPtr make_kernel(const KernelContext& site, const ops::Gradient<ops::SoftmaxSum>& op) {
  return std::make_unique<SoftmaxSumGradient>(site, op);
}

}  // namespace bitr::vk
