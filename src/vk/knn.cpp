#include <algorithm>
#include <optional>

#include "knn.spv.hpp"
#include "knn_shuffle.spv.hpp"
#include "vk/kernel.hpp"
#include "vk/knn_tree.hpp"

namespace bitr::vk {
namespace {

constexpr Access bindings[] = {Access::read, Access::read,   Access::read,
                               Access::read, Access::modify, Access::modify};
constexpr Shader basic{"knn", spirv::knn, bindings, sizeof(KnnParameters), 4};
constexpr Shader shuffle{"knn_shuffle", spirv::knn_shuffle, bindings, sizeof(KnnParameters), 4};

// One dispatch looks at so many references, or shaders/knn.comp would exceed what some drivers loop.
constexpr std::uint32_t most_references_limited = 32768, most_references_unlimited = 1u << 22;

// From so many points in a cloud on the tree is faster (measured; docs/performance.md).
constexpr std::size_t tree_points = 4096;

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
        capabilities_(site.context.capabilities()),
        most_references_(capabilities_.loop_limit < most_references_unlimited ? most_references_limited
                                                                              : most_references_unlimited) {
    if (wants_tree(site.largest)) tree_.emplace(site.context, op.k);
  }

  std::size_t scratch_bytes(const graph::BatchLayout& layout) const override {
    if (wants_tree(layout)) return KnnTree::scratch_bytes(layout, capabilities_);
    const bool parts = largest_segment(layout) > most_references_;
    return sizeof(float) * static_cast<std::size_t>(op_.k) * (parts ? layout.rows(queries_) : 1);
  }

  void record(const Arguments& args) const override {
    if (wants_tree(args.layout))
      return tree_->record(args.schedule, args.layout, args.tables.point, args.in[0], args.out[0],
                           args.scratch);
    const RowTable &queries = args.tables.of(queries_), &references = args.tables.of(references_);
    const std::size_t largest = largest_segment(args.layout);
    const double cost = 3.0 * op_.dim * static_cast<double>(std::min<std::size_t>(largest, most_references_));
    const Slot& index = args.out[0];
    const bool parts = largest > most_references_;
    for (const TileRun& run :
         tile_runs(queries, capabilities_, cost, sizeof(float) * static_cast<std::size_t>(op_.k)))
      for (std::uint32_t first = 0; first < largest; first += most_references_) {
        const Range distances = parts ? rows_of({args.scratch, queries_, op_.k, 1}, run) : args.scratch;
        args.schedule.dispatch(pipeline_,
                               {args.in[0].range, args.in[1].range, queries.tiles, references.offsets,
                                rows_of(index, run), distances},
                               KnnParameters{run.first, run.first_row, first, most_references_},
                               {run.count, 1, 1}, cost * (run.end_row - run.first_row));
      }
  }

 private:
  bool wants_tree(const graph::BatchLayout& layout) const {
    return op_.exclude_self && op_.dim == 3 && queries_ == graph::Rows::point &&
           largest_segment(layout) >= tree_points;
  }
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
  const std::uint32_t most_references_;
  std::optional<KnnTree> tree_;  // where the capacity allows clouds that want it
};

}  // namespace

KernelPtr make_kernel(const Site& site, const ops::Knn& op) { return std::make_unique<KnnKernel>(site, op); }

}  // namespace bitr::vk
