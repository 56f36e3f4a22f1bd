#include <algorithm>

#include "knn.spv.hpp"
#include "knn_shuffle.spv.hpp"
#include "vk/kernel.hpp"

namespace bitr::vk {
namespace {

constexpr Access bindings[] = {Access::read, Access::read,   Access::read,
                               Access::read, Access::modify, Access::modify};
constexpr Shader basic{"knn", spirv::knn, bindings, sizeof(KnnParameters), 4};
constexpr Shader shuffle{"knn_shuffle", spirv::knn_shuffle, bindings, sizeof(KnnParameters), 4};

// One dispatch looks at so many references: shaders/knn.comp counts its loop on it.
constexpr std::uint32_t most_references = 32768;

class KnnKernel : public Kernel {
 public:
  KnnKernel(const Site& site, const ops::Knn& op)
      : op_(op),
        references_(site.in[1].rows),
        queries_(site.out[0].rows),
        pipeline_(site.context.pipeline(
            site.context.capabilities().shuffle ? shuffle : basic,
            std::array{tile_rows, static_cast<std::uint32_t>(op.k), static_cast<std::uint32_t>(op.dim),
                       static_cast<std::uint32_t>(op.exclude_self)})),
        capabilities_(site.context.capabilities()) {}

  std::size_t scratch_bytes(const graph::BatchLayout& layout) const override {
    const bool parts = largest_segment(layout) > most_references;
    return sizeof(float) * static_cast<std::size_t>(op_.k) * (parts ? layout.rows(queries_) : 1);
  }

  void record(const Arguments& args) const override {
    const RowTable &queries = args.tables.of(queries_), &references = args.tables.of(references_);
    const std::size_t largest = largest_segment(args.layout);
    const double cost = 3.0 * op_.dim * static_cast<double>(std::min<std::size_t>(largest, most_references));
    const Slot& index = args.out[0];
    const bool parts = largest > most_references;
    for (const TileRun& run : tile_runs(queries, capabilities_, cost))
      for (std::uint32_t first = 0; first < largest; first += most_references) {
        const Range distances = parts ? rows_of({args.scratch, queries_, op_.k, 1}, run) : args.scratch;
        args.schedule.dispatch(pipeline_,
                               {args.in[0].range, args.in[1].range, queries.tiles, references.offsets,
                                rows_of(index, run), distances},
                               KnnParameters{run.first, run.first_row, first, most_references},
                               {run.count, 1, 1}, cost * (run.end_row - run.first_row));
      }
  }

 private:
  std::size_t largest_segment(const graph::BatchLayout& layout) const {
    std::size_t largest = 0;
    for (std::uint32_t s = 0; s < layout.segments(references_); ++s)
      largest = std::max(largest, layout.begin(references_, s + 1) - layout.begin(references_, s));
    return largest;
  }

  const ops::Knn op_;
  const graph::Rows references_, queries_;
  const Pipeline& pipeline_;
  const Capabilities& capabilities_;
};

}  // namespace

KernelPtr make_kernel(const Site& site, const ops::Knn& op) { return std::make_unique<KnnKernel>(site, op); }

}  // namespace bitr::vk
