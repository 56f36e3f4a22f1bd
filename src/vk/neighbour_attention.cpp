#include <algorithm>

#include "neighbour_attention.spv.hpp"
#include "vk/kernel.hpp"

namespace bitr::vk {
namespace {

constexpr std::uint32_t attention_group = 64;
constexpr std::uint32_t queries_per_group = 8;

class NeighbourAttentionKernel : public Kernel {
 public:
  NeighbourAttentionKernel(const KernelContext& site, const ops::NeighbourAttention& op)
      : op_(op),
        heads_(static_cast<std::uint32_t>(site.in[0].per_row)),
        pipeline_(
            site.context.pipeline(shaders::neighbour_attention,
                                  std::array{attention_group, static_cast<std::uint32_t>(site.in[3].per_row),
                                             heads_, static_cast<std::uint32_t>(site.in[0].width),
                                             static_cast<std::uint32_t>(site.in[2].width)})),
        capabilities_(site.context.capabilities()) {}

  void record(const Arguments& args) const override {
    const Slot &queries = args.in[0], &index = args.in[3], &result = args.out[0];
    const std::size_t rows = args.layout.rows(result.rows);
    const std::size_t row_bytes = std::max({queries.range.size, index.range.size, result.range.size}) / rows;
    const double cost = 2.0 * heads_ * index.per_row * (queries.width + result.width + 10.0);
    const std::size_t most = std::min<std::size_t>(capabilities_.storage_range / row_bytes,
                                                   std::size_t{queries_per_group} * capabilities_.groups);
    for (const RowRun& run : row_runs(rows, most, cost)) {
      const auto count = static_cast<std::uint32_t>(run.count);
      args.schedule.dispatch(pipeline_,
                             {run.of(queries, rows), args.in[1].range, args.in[2].range, run.of(index, rows),
                              run.of(result, rows)},
                             NeighbourAttentionParameters{count, static_cast<float>(op_.scale)},
                             {(count + queries_per_group - 1) / queries_per_group, heads_, 1}, cost * count);
    }
  }

 private:
  const ops::NeighbourAttention op_;
  const std::uint32_t heads_;
  PipelineOf<NeighbourAttentionParameters> pipeline_;
  const Capabilities& capabilities_;
};

}  // namespace

template <>
KernelPtr make_kernel(const KernelContext& site, const ops::NeighbourAttention& op) {
  return std::make_unique<NeighbourAttentionKernel>(site, op);
}

}  // namespace bitr::vk
