#include "softmax_sum.spv.hpp"

#include <algorithm>

#include "softmax_sum_combine.spv.hpp"
#include "vk/kernel.hpp"
#include "vk/memory.hpp"

namespace bitr::vk {
namespace {

constexpr std::uint32_t chunk_rows = 128;
constexpr std::size_t partial_bytes = 8 * sizeof(float);

// The sums of one values tensor.
struct WeightedSum {
  std::uint32_t items;      ///< channels × vec4s of columns
  std::uint32_t parts = 1;  ///< in so many a chunk is summed
  PipelineOf<PointParameters> chunks = {};
  PipelineOf<SegmentParameters> combine = {};
};

class SoftmaxSumKernel : public Kernel {
 public:
  SoftmaxSumKernel(const KernelContext& site, const ops::SoftmaxSum& op)
      : capabilities_(site.context.capabilities()), logit_bytes_(sizeof(float) * padded(site.in[0].width)) {
    const auto channels = static_cast<std::uint32_t>(op.channels);
    for (std::size_t i = 0; i < op.skip.size(); ++i) {
      const auto columns = static_cast<std::uint32_t>(site.out[i].width);
      WeightedSum sum{channels * padded(site.out[i].width) / 4};
      // As many as keep a work group's invocations busy.
      while (sum.parts < 16 && 2 * sum.parts * sum.items <= tile_rows) sum.parts *= 2;
      sum.chunks = site.context.pipeline(
          shaders::softmax_sum,
          std::array{tile_rows, channels, padded(site.in[0].width), padded(site.in[i + 1].width),
                     static_cast<std::uint32_t>(op.skip[i]), columns, sum.parts});
      sum.combine = site.context.pipeline(shaders::softmax_sum_combine,
                                          std::array{tile_rows, channels, columns, sum.parts});
      sums_.push_back(sum);
    }
  }

  std::size_t scratch_bytes(const graph::BatchLayout& layout) const override {
    std::size_t bytes = 0;
    for (const WeightedSum& sum : sums_) bytes += partials_bytes(sum, layout);
    return bytes;
  }

  void record(const Arguments& args) const override {
    const RowTable& points = args.tables.point;
    std::vector<Range> partials;
    std::size_t at = 0;
    for (const WeightedSum& sum : sums_) {
      const std::size_t bytes = partials_bytes(sum, args.layout);
      partials.push_back(args.scratch.sub(at, bytes));
      at += bytes;
    }
    for (std::size_t i = 0; i < sums_.size(); ++i) {
      const double cost = 24.0 * sums_[i].items;
      for (const TileRun& run : tile_runs(points, capabilities_, cost, logit_bytes_, chunk_rows))
        args.schedule.dispatch(sums_[i].chunks,
                               {rows_of(args.in[0].range, logit_bytes_, run, chunk_rows),
                                args.in[i + 1].range, points.tiles, points.offsets, partials[i]},
                               PointParameters{run.first, run.first_row}, {run.count, 1, 1},
                               cost * (run.end_row - run.first_row));
    }
    const std::uint32_t clouds = args.layout.clouds();
    for (std::size_t i = 0; i < sums_.size(); ++i)
      for (std::uint32_t first = 0; first < clouds; first += capabilities_.groups)
        args.schedule.dispatch(sums_[i].combine, {partials[i], points.offsets, args.out[i].range},
                               SegmentParameters{first, clouds},
                               {sums_[i].items, std::min(clouds - first, capabilities_.groups), 1},
                               static_cast<double>(args.layout.rows(graph::Rows::point)) / chunk_rows *
                                   sums_[i].parts * sums_[i].items * 20);
  }

 private:
  std::size_t partials_bytes(const WeightedSum& sum, const graph::BatchLayout& layout) const {
    const std::size_t chunks = layout.rows(graph::Rows::point) / chunk_rows + layout.clouds();
    const std::size_t bytes = chunks * sum.parts * sum.items * partial_bytes;
    return aligned(bytes, capabilities_.alignment);
  }

  const Capabilities& capabilities_;
  const std::size_t logit_bytes_;  // bytes of a row
  std::vector<WeightedSum> sums_;
};

}  // namespace

template <>
KernelPtr make_kernel(const KernelContext& site, const ops::SoftmaxSum& op) {
  return std::make_unique<SoftmaxSumKernel>(site, op);
}

}  // namespace bitr::vk
