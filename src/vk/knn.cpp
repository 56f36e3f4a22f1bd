#include <algorithm>
#include <optional>

#include "core/failure.hpp"
#include "knn.spv.hpp"
#include "knn_shuffle.spv.hpp"
#include "vk/kernel.hpp"
#include "vk/knn_tree.hpp"

namespace bitr::vk {
namespace {

// An invocation keeps them in registers.
constexpr int most_nearest = 128;
constexpr std::size_t found_bytes = 2 * sizeof(std::uint32_t);

// One dispatch looks at so many references, or shaders/knn.comp would exceed what some drivers loop.
constexpr std::uint32_t most_references_limited = 32768, most_references_unlimited = 1u << 22;

// From so many points in a cloud on the tree is faster (measured; docs/performance.md).
constexpr std::size_t tree_points = 4096;

class KnnKernel : public Kernel {
 public:
  KnnKernel(const KernelContext& site, const ops::Knn& op)
      : op_(checked(op)),
        references_(site.in[1].rows),
        queries_(site.out[0].rows),
        pipeline_(site.context.pipeline(
            site.context.capabilities().shuffle ? shaders::knn_shuffle : shaders::knn,
            std::array{tile_rows, static_cast<std::uint32_t>(op.k), static_cast<std::uint32_t>(op.dim),
                       static_cast<std::uint32_t>(op.exclude_self),
                       static_cast<std::uint32_t>(op.dilation)})),
        capabilities_(site.context.capabilities()),
        most_references_(capabilities_.loop_limit < most_references_unlimited ? most_references_limited
                                                                              : most_references_unlimited) {
    if (wants_tree(site.largest)) tree_.emplace(site.context, op.k, op.dilation);
  }

  std::size_t scratch_bytes(const graph::BatchLayout& layout) const override {
    if (wants_tree(layout)) return KnnTree::scratch_bytes(layout, capabilities_);
    const bool parts = largest_segment(layout) > most_references_;
    return found_bytes * nearest() * (parts ? layout.rows(queries_) : 1);
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
    const std::size_t row_bytes =
        parts ? found_bytes * nearest() : sizeof(std::uint32_t) * static_cast<std::size_t>(op_.k);
    for (const TileRun& run : tile_runs(queries, capabilities_, cost, row_bytes))
      for (std::uint32_t first = 0; first < largest; first += most_references_) {
        const int found_numbers = static_cast<int>(2 * nearest());
        const Range found = parts ? rows_of({args.scratch, queries_, found_numbers, 1}, run) : args.scratch;
        args.schedule.dispatch(pipeline_,
                               {args.in[0].range, args.in[1].range, queries.tiles, references.offsets,
                                rows_of(index, run), found},
                               KnnParameters{run.first, run.first_row, first, most_references_},
                               {run.count, 1, 1}, cost * (run.end_row - run.first_row));
      }
  }

 private:
  static const ops::Knn& checked(const ops::Knn& op) {
    if (op.k * op.dilation > most_nearest)
      throw Failure(ErrorCode::unsupported,
                    std::to_string(op.k) + " neighbours at a dilation of " + std::to_string(op.dilation) +
                        " are found among the nearest " + std::to_string(op.k * op.dilation) +
                        ", Vulkan finds up to " + std::to_string(most_nearest));
    return op;
  }
  std::size_t nearest() const { return static_cast<std::size_t>(op_.k * op_.dilation); }
  bool wants_tree(const graph::BatchLayout& layout) const {
    if (!op_.exclude_self || op_.dim != 3 || queries_ != graph::Rows::point) return false;
    if (op_.search != NeighborSearch::automatic) return op_.search == NeighborSearch::tree;
    return largest_segment(layout) >= tree_points;
  }
  std::size_t largest_segment(const graph::BatchLayout& layout) const {
    std::size_t largest = 0;
    for (std::uint32_t s = 0; s < layout.segments(references_); ++s)
      largest = std::max(largest, layout.begin(references_, s + 1) - layout.begin(references_, s));
    return largest;
  }

  const ops::Knn op_;
  const graph::Rows references_, queries_;
  PipelineOf<KnnParameters> pipeline_;
  const Capabilities& capabilities_;
  const std::uint32_t most_references_;
  std::optional<KnnTree> tree_;  // where the capacity allows clouds that want it
};

}  // namespace

template <>
KernelPtr make_kernel(const KernelContext& site, const ops::Knn& op) {
  return std::make_unique<KnnKernel>(site, op);
}

}  // namespace bitr::vk
