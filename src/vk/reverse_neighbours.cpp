#include "vk/reverse_neighbours.hpp"

#include <algorithm>

#include "core/failure.hpp"
#include "gather_edges.spv.hpp"
#include "gather_edges_texels.spv.hpp"
#include "reverse_neighbours_clear.spv.hpp"
#include "reverse_neighbours_count.spv.hpp"
#include "reverse_neighbours_fill.spv.hpp"
#include "reverse_neighbours_scan.spv.hpp"
#include "reverse_neighbours_sort.spv.hpp"
#include "vk/memory.hpp"

namespace bitr::vk {
namespace {

constexpr std::uint32_t reverse_group = 128;

std::uint32_t part(const EdgeGather::Shape& shape) { return std::min(shape.width / 4, 4u); }
std::size_t list_bytes(std::size_t count) { return scratch_aligned(sizeof(std::uint32_t) * count); }

}  // namespace

ReverseNeighbours::ReverseNeighbours(const Context& context, int k)
    : capabilities_(context.capabilities()),
      k_(static_cast<std::uint32_t>(k)),
      clear_(context.pipeline(shaders::reverse_neighbours_clear, std::array{reverse_group})),
      count_(context.pipeline(shaders::reverse_neighbours_count, std::array{reverse_group})),
      scan_(context.pipeline(shaders::reverse_neighbours_scan, std::array{reverse_group, k_})),
      fill_(context.pipeline(shaders::reverse_neighbours_fill, std::array{reverse_group})),
      sort_(context.pipeline(shaders::reverse_neighbours_sort, std::array{reverse_group})) {}

std::size_t ReverseNeighbours::bytes(std::size_t rows, std::size_t neighbors) const {
  return 2 * list_bytes(neighbors) + 2 * list_bytes(rows * k_);
}

EdgeLists ReverseNeighbours::record(const Arguments& args, const Slot& index, graph::Rows rows,
                                    graph::Rows neighbors) const {
  const auto count = static_cast<std::uint32_t>(args.layout.rows(neighbors));
  const auto edges = static_cast<std::uint32_t>(args.layout.rows(rows) * k_);
  if (sizeof(std::uint32_t) * edges > capabilities_.storage_range)
    throw Failure(ErrorCode::unsupported, "a batch with " + std::to_string(edges) +
                                              " edges; the device binds the lists of " +
                                              std::to_string(capabilities_.storage_range / 4));
  const Range &scratch = args.lists, counts = scratch.sub(0, sizeof(std::uint32_t) * count),
              begins = scratch.sub(list_bytes(count), counts.size),
              places = scratch.sub(2 * list_bytes(count), sizeof(std::uint32_t) * edges),
              unsorted = scratch.sub(2 * list_bytes(count) + list_bytes(edges), places.size);
  if (!args.make_lists) return {begins, counts, places};
  const auto all = [&](PipelineOf<EdgeParameters> pipeline, std::uint32_t items,
                       const std::vector<Range>& ranges) {
    const std::uint32_t most = capabilities_.groups * reverse_group;
    for (std::uint32_t first = 0; first < items; first += most) {
      const std::uint32_t end = items - first > most ? first + most : items;
      args.schedule.dispatch(pipeline, ranges, EdgeParameters{first, end},
                             {(end - first + reverse_group - 1) / reverse_group, 1, 1}, 30.0 * (end - first));
    }
  };
  all(clear_, count, {counts});
  all(count_, edges, {index.range, counts, places});
  const std::uint32_t segments = args.layout.segments(neighbors);
  for (std::uint32_t first = 0; first < segments; first += capabilities_.groups)
    args.schedule.dispatch(scan_,
                           {counts, args.tables.of(neighbors).offsets, args.tables.of(rows).offsets, begins},
                           SegmentParameters{first, segments},
                           {std::min(segments - first, capabilities_.groups), 1, 1}, 10.0 * count);
  all(fill_, edges, {index.range, begins, places, unsorted});
  // The places are not needed any more: the sorted lists take theirs.
  all(sort_, count, {begins, counts, unsorted, places});
  return {begins, counts, places};
}

EdgeGather::EdgeGather(const Context& context, const Shape& shape)
    : shape_(shape),
      pipeline_(context.pipeline(
          context.capabilities().texels ? shaders::gather_edges_texels : shaders::gather_edges,
          std::array{
              tile_rows, shape.width / 4, shape.record, shape.own,
              (shape.has_own ? 1u : 0u) | (shape.has_edges ? 2u : 0u) | (shape.both_ends > 0 ? 4u : 0u),
              shape.edge, shape.at, shape.both_ends, part(shape)})) {}

void EdgeGather::record(const Arguments& args, const Run& run, const EdgeLists& lists, const Range& edges,
                        const Range& record, const RowTable& table, const Range& result) const {
  if (run.tiles == 0) return;
  args.schedule.dispatch(pipeline_,
                         {lists.begins, lists.counts, lists.list, edges, record, table.tiles, result},
                         GatherParameters{run.first_tile, run.first_row, run.first_edge},
                         {run.tiles, (shape_.width / 4 + part(shape_) - 1) / part(shape_), 1},
                         100.0 * run.tiles * tile_rows * shape_.width);
}

}  // namespace bitr::vk
