#include "vk/outer_sums.hpp"

#include <algorithm>

#include "core/failure.hpp"
#include "outer_sums.spv.hpp"
#include "outer_sums_texels.spv.hpp"
#include "outer_totals.spv.hpp"

namespace bitr::vk {
namespace {

constexpr std::uint32_t if_flagged = 0x80000000, no_place = 0xffffffff;
constexpr std::uint32_t block = 4, block_bytes = block * block * sizeof(float);
constexpr std::uint32_t outer_sums_group = 32;
constexpr std::uint32_t most_tiles = 65000;  // one loop goes through them all

std::uint32_t blocks(std::uint32_t size) { return (size + block - 1) / block; }

}  // namespace

void OuterSums::add(const RecordVectors& left, const RecordVectors& right, std::uint32_t components,
                    bool row_major, bool flagged) {
  const std::uint32_t first = job_count();
  for (std::uint32_t l = 0; l < blocks(left.size); ++l)
    for (std::uint32_t r = 0; r < blocks(right.size); ++r)
      jobs_.insert(jobs_.end(), {left.at + l, right.at + r, left.step | (right.step << 16),
                                 components | (flagged ? if_flagged : 0)});
  const auto place = [&](std::uint32_t l, std::uint32_t r) {
    const std::uint32_t job = first + l / block * blocks(right.size) + r / block;
    places_.push_back((job * block + l % block) * block + r % block);
  };
  const std::uint32_t rows = left.size, columns = right.size;
  for (std::uint32_t i = 0; i < rows * columns; ++i)
    row_major ? place(i / columns, i % columns) : place(i % rows, i / rows);
}

std::vector<std::uint32_t> OuterSums::places() const {
  std::vector<std::uint32_t> all = places_;
  all.resize(padded(static_cast<int>(begin_ + all.size())) - begin_, no_place);
  return all;
}

void OuterSums::make_pipelines(const Context& context, std::uint32_t record, std::uint32_t flag,
                               bool segmented) {
  capabilities_ = &context.capabilities();
  segmented_ = segmented;
  sums_ = context.pipeline(capabilities_->texels ? shaders::outer_sums_texels : shaders::outer_sums,
                           std::array{outer_sums_group, record, flag});
  totals_ = context.pipeline(shaders::outer_totals, std::array{outer_sums_group, number(places().size()),
                                                               static_cast<std::uint32_t>(segmented)});
}

std::size_t OuterSums::partial_bytes(const graph::BatchLayout& layout, graph::Rows rows) const {
  const std::size_t tiles = layout.rows(rows) / tile_rows + layout.segments(rows);
  return tiles * job_count() * block_bytes;
}

void OuterSums::record_sums(const Arguments& args, const Memory& memory, const Range& records,
                            const RowTable& table, std::uint32_t first, std::uint32_t count,
                            std::uint32_t first_row) const {
  const std::size_t tiles = table.host_tiles.size();
  if (tiles > most_tiles || tiles * job_count() * block_bytes > capabilities_->storage_range)
    throw Failure(ErrorCode::unsupported,
                  "a batch of " + std::to_string(tiles) + " tiles of 32 rows is too large to train on");
  const std::uint32_t groups = (job_count() + outer_sums_group - 1) / outer_sums_group;
  if (count > 0)
    args.schedule.dispatch(sums_, {records, table.tiles, memory.jobs, memory.partials},
                           OuterParameters{first, first_row, job_count()}, {count, groups, 1},
                           3.0 * 40 * count * tile_rows * job_count());
}

void OuterSums::record_totals(const Arguments& args, const Memory& memory, const RowTable& table,
                              std::uint32_t segments, const Range& result) const {
  const std::uint32_t groups = (number(places().size()) + outer_sums_group - 1) / outer_sums_group;
  const std::uint32_t rows = segmented_ ? segments : 1, tiles = number(table.host_tiles.size());
  for (std::uint32_t first = 0; first < rows; first += capabilities_->groups)
    args.schedule.dispatch(totals_, {memory.partials, table.tiles, memory.places, result},
                           OuterTotalParameters{tiles, job_count(), first, begin_},
                           {groups, std::min(rows - first, capabilities_->groups), 1},
                           10.0 * tiles * outer_sums_group * groups);
}

}  // namespace bitr::vk
