#include "vk/knn_tree.hpp"

#include <algorithm>

#include "knn_tree.spv.hpp"
#include "knn_tree_blocks.spv.hpp"
#include "knn_tree_bounds.spv.hpp"
#include "knn_tree_clear.spv.hpp"
#include "knn_tree_count.spv.hpp"
#include "knn_tree_levels.spv.hpp"
#include "knn_tree_scan.spv.hpp"
#include "knn_tree_scatter.spv.hpp"
#include "knn_tree_shuffle.spv.hpp"
#include "vk/memory.hpp"

namespace bitr::vk {
namespace {

constexpr std::uint32_t tree_lanes = 128;
constexpr std::size_t cells_per_point = 8;  // shaders/common/knn_tree.glsl
// Boxes met and points compared, of a point's search.
constexpr double tree_search_cost = 6000;

struct Parts {
  std::size_t sorted, grids, cells, boxes, bytes;
};

Parts tree_parts(const graph::BatchLayout& layout, std::size_t alignment) {
  const std::size_t points = layout.rows(graph::Rows::point), clouds = layout.clouds();
  const auto after = [alignment](std::size_t begin, std::size_t bytes) {
    return aligned(begin + bytes, alignment);
  };
  Parts parts{};
  parts.grids = after(parts.sorted, 16 * points);
  parts.cells = after(parts.grids, 32 * clouds);
  parts.boxes = after(parts.cells, 4 * cells_per_point * points);
  // first_node() of the cloud after the last.
  parts.bytes = after(parts.boxes, 32 * (2 * (points / tile_rows + clouds) + 8 * clouds));
  return parts;
}

}  // namespace

KnnTree::KnnTree(const Context& context, int k, int dilation)
    : capabilities_(context.capabilities()),
      bounds_(context.pipeline(shaders::knn_tree_bounds, std::array{tree_lanes})),
      scan_(context.pipeline(shaders::knn_tree_scan, std::array{tree_lanes})),
      levels_(context.pipeline(shaders::knn_tree_levels, std::array{tree_lanes})),
      clear_(context.pipeline(shaders::knn_tree_clear, std::array{tile_rows})),
      count_(context.pipeline(shaders::knn_tree_count, std::array{tile_rows})),
      scatter_(context.pipeline(shaders::knn_tree_scatter, std::array{tile_rows})),
      blocks_(context.pipeline(shaders::knn_tree_blocks, std::array{tile_rows})),
      search_(context.pipeline(
          capabilities_.shuffle ? shaders::knn_tree_shuffle : shaders::knn_tree,
          std::array{tile_rows, static_cast<std::uint32_t>(k), static_cast<std::uint32_t>(dilation)})) {}

std::size_t KnnTree::scratch_bytes(const graph::BatchLayout& layout, const Capabilities& capabilities) {
  return tree_parts(layout, capabilities.alignment).bytes;
}

void KnnTree::record(Schedule& schedule, const graph::BatchLayout& layout, const RowTable& table,
                     const Slot& points, const Slot& index, const Range& scratch) const {
  const Parts parts = tree_parts(layout, capabilities_.alignment);
  const Range sorted = scratch.sub(parts.sorted, parts.grids - parts.sorted);
  const Range grids = scratch.sub(parts.grids, parts.cells - parts.grids);
  const Range cells = scratch.sub(parts.cells, parts.boxes - parts.cells);
  const Range boxes = scratch.sub(parts.boxes, parts.bytes - parts.boxes);
  const auto rows = static_cast<double>(layout.rows(graph::Rows::point));
  const std::array<std::uint32_t, 3> per_cloud = {layout.clouds(), 1, 1};

  schedule.dispatch(bounds_, {points.range, table.offsets, grids}, per_cloud, 20 * rows);
  const auto runs = tile_runs(table, capabilities_, 30);
  const auto by_tiles = [&](PipelineOf<TileParameters> pipeline, const std::vector<Range>& ranges) {
    for (const TileRun& run : runs)
      schedule.dispatch(pipeline, ranges, TileParameters{run.first}, {run.count, 1, 1}, 30 * rows);
  };
  by_tiles(clear_, {table.tiles, cells});
  by_tiles(count_, {points.range, table.tiles, table.offsets, grids, cells});
  schedule.dispatch(scan_, {table.offsets, grids, cells}, per_cloud, 10 * rows);
  by_tiles(scatter_, {points.range, table.tiles, table.offsets, grids, cells, sorted});
  by_tiles(blocks_, {sorted, table.tiles, table.offsets, boxes});
  schedule.dispatch(levels_, {table.offsets, boxes}, per_cloud, rows);

  // Queries go in the order of the tree, results to any row of the cloud: a dispatch binds whole clouds.
  const auto& tiles = table.host_tiles;
  const std::size_t row_bytes = sizeof(std::uint32_t) * static_cast<std::size_t>(index.per_row);
  const auto most_tiles = static_cast<std::uint32_t>(
      std::clamp(most_cost / (tree_search_cost * tile_rows), 1.0, static_cast<double>(capabilities_.groups)));
  for (std::uint32_t first = 0; first < tiles.size();) {
    const std::uint32_t first_row = tiles[first][1] / 64 * 64;
    std::uint32_t end = first, cloud_end = first;
    for (std::uint32_t cloud = tiles[first][0]; cloud_end < tiles.size(); ++cloud) {
      while (cloud_end < tiles.size() && tiles[cloud_end][0] == cloud) ++cloud_end;
      if (end > first && (tiles[cloud_end - 1][2] - first_row) * row_bytes > capabilities_.storage_range)
        break;
      end = cloud_end;
    }
    const Range rows_index =
        index.range.sub(first_row * row_bytes, (tiles[end - 1][2] - first_row) * row_bytes);
    for (std::uint32_t at = first; at < end; at += most_tiles) {
      const std::uint32_t count = std::min(most_tiles, end - at);
      schedule.dispatch(search_, {sorted, table.tiles, table.offsets, boxes, rows_index, points.range},
                        PointParameters{at, first_row}, {count, 1, 1}, tree_search_cost * tile_rows * count);
    }
    first = end;
  }
}

}  // namespace bitr::vk
