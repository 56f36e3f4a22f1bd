#include "vk/kernel.hpp"

#include <algorithm>
#include <bit>

#include "core/failure.hpp"

namespace bitr::vk {

void Kernel::add_constant(double value) {
  constants_.push_back(std::bit_cast<std::uint32_t>(static_cast<float>(value)));
}

void Kernel::add_constants(const Eigen::MatrixXd& matrix) {
  for (Eigen::Index r = 0; r < matrix.rows(); ++r)
    for (Eigen::Index c = 0; c < matrix.cols(); ++c) add_constant(matrix(r, c));
}

KernelPtr kernel_for(const KernelContext& site, const ops::Op& op) {
  return std::visit(
      [&](const auto& concrete) -> KernelPtr {
        if constexpr (only_on_cpu<std::remove_cvref_t<decltype(concrete)>>)
          throw Failure(ErrorCode::unsupported, "an operation of the graph runs on the CPU only");
        else
          return make_kernel(site, concrete);
      },
      op);
}

std::vector<TileRun> tile_runs(const RowTable& table, const Capabilities& capabilities, double cost_per_row,
                               std::size_t row_bytes, std::size_t beyond) {
  double tiles = most_cost / (cost_per_row * tile_rows);
  // A run is bound from a multiple of 64 rows on.
  if (row_bytes > 0)
    tiles = std::min(tiles, (static_cast<double>(capabilities.storage_range / row_bytes) - 64 -
                             static_cast<double>(beyond)) /
                                tile_rows);
  const std::uint32_t most =
      static_cast<std::uint32_t>(std::clamp(tiles, 1.0, static_cast<double>(capabilities.groups)));
  std::vector<TileRun> runs;
  const auto& all = table.host_tiles;
  for (std::uint32_t first = 0; first < all.size(); first += most) {
    const std::uint32_t count = std::min<std::uint32_t>(most, static_cast<std::uint32_t>(all.size()) - first);
    runs.push_back({first, count, all[first][1] / 64 * 64, all[first + count - 1][2]});
  }
  return runs;
}

Range rows_of(const Slot& index, const TileRun& run) {
  return rows_of(index.range, sizeof(std::uint32_t) * static_cast<std::size_t>(index.per_row), run);
}

Range rows_of(const Range& rows, std::size_t row_bytes, const TileRun& run, std::size_t beyond) {
  const std::size_t begin = run.first_row * row_bytes;
  return rows.sub(begin, std::min((run.end_row + beyond) * row_bytes, rows.size) - begin);
}

std::vector<RowRun> row_runs(std::size_t rows, std::size_t most_rows, double cost_per_row) {
  const std::size_t most =
      std::max<std::size_t>(std::min(most_rows, static_cast<std::size_t>(most_cost / cost_per_row)) / 64, 1) *
      64;
  std::vector<RowRun> runs;
  for (std::size_t first = 0; first < rows; first += most)
    runs.push_back({first, std::min(most, rows - first)});
  return runs;
}

}  // namespace bitr::vk
