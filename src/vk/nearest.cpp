#include "vk/nearest.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <utility>

#include "core/halves.hpp"
#include "nearest.spv.hpp"
#include "nearest_shuffle.spv.hpp"
#include "vk/kernel.hpp"
#include "vk/memory.hpp"

namespace bitr::vk {
namespace {

// Boxes met and points compared, of a point's search.
constexpr double search_cost = 6000;
// In radii of the cloud: from farther away single precision takes different points for equally near.
constexpr double sight = 16;

}  // namespace

Nearest::Cloud::Cloud(const std::vector<Vec3d>& points) {
  Vec3d low = points[0], high = low;
  for (const Vec3d& point : points)
    for (int a = 0; a < 3; ++a) {
      low[a] = std::min(low[a], point[a]);
      high[a] = std::max(high[a], point[a]);
    }
  double radius = 0;
  for (int a = 0; a < 3; ++a) {
    centre[a] = low[a] + (high[a] - low[a]) / 2;
    radius = std::max(radius, (high[a] - low[a]) / 2);
  }
  // A power of two rounds nothing.
  if (std::isnormal(radius)) scale = std::ldexp(1, -std::ilogb(radius) - 1);

  const std::vector<std::uint32_t> order = order_of(points);
  for (std::size_t i = 0; i < order.size(); ++i) {
    float at[4];
    write(points[order[i]], at);
    sorted.push_back({});
    std::memcpy(sorted.back().data(), at, sizeof at);
    sorted.back()[3] = order[i];
    if (i % tile_rows == 0) boxes.push_back({at[0], at[1], at[2], 0, at[0], at[1], at[2], 0});
    for (std::size_t a = 0; a < 3; ++a) {
      boxes.back()[a] = std::min(boxes.back()[a], at[a]);
      boxes.back()[4 + a] = std::max(boxes.back()[4 + a], at[a]);
    }
  }
  for (std::size_t begin = 0, end = boxes.size(); end - begin > 1; begin = std::exchange(end, boxes.size()))
    for (std::size_t node = begin; node < end; ++node) {
      if ((node - begin) % 8 == 0) boxes.push_back(boxes[node]);
      for (std::size_t a = 0; a < 3; ++a) {
        boxes.back()[a] = std::min(boxes.back()[a], boxes[node][a]);
        boxes.back()[4 + a] = std::max(boxes.back()[4 + a], boxes[node][4 + a]);
      }
    }
}

std::vector<std::uint32_t> Nearest::order_of(const std::vector<Vec3d>& points) {
  std::vector<std::uint32_t> order(points.size());
  std::iota(order.begin(), order.end(), 0);
  // Nodes of the tree are whole ranges.
  order_by_halves(points, order.data(), order.data() + order.size(), tile_rows,
                  [](std::size_t blocks) { return std::bit_ceil(blocks) / 2; });
  return order;
}

bool Nearest::Cloud::sees(const Vec3d& point) const {
  for (int a = 0; a < 3; ++a)
    if (!(std::abs((point[a] - centre[a]) * scale) <= sight)) return false;
  return true;
}

void Nearest::Cloud::write(const Vec3d& point, float* query) const {
  for (int a = 0; a < 3; ++a) {
    const double at = (point[a] - centre[a]) * scale;
    query[a] = static_cast<float>(std::clamp(at, -2 * sight, 2 * sight));
  }
  query[3] = 0;
}

Nearest::Nearest(const Context& context) : context_(context), submitter_(context) {
  for (const std::uint32_t wanted : {1u, most_wanted}) {
    const auto& shader = context.capabilities().shuffle ? shaders::nearest_shuffle : shaders::nearest;
    groups_.push_back({wanted, context.pipeline(shader, std::array{tile_rows, wanted})});
  }
}

std::uint32_t Nearest::add(Cloud cloud) {
  clouds_.push_back(std::move(cloud));
  return static_cast<std::uint32_t>(clouds_.size() - 1);
}

void Nearest::upload_clouds() {
  if (uploaded_ == clouds_.size()) return;
  std::size_t points = 0, nodes = 0;
  std::vector<std::array<std::uint32_t, 4>> table;
  for (const Cloud& cloud : clouds_) {
    table.push_back({static_cast<std::uint32_t>(points),
                     static_cast<std::uint32_t>(points + cloud.sorted.size()),
                     static_cast<std::uint32_t>(nodes), 0});
    points += cloud.sorted.size();
    nodes += cloud.boxes.size();
  }
  const std::size_t alignment = context_.capabilities().alignment;
  const std::size_t sorted_begin = aligned(16 * table.size(), alignment);
  const std::size_t boxes_begin = aligned(sorted_begin + 16 * points, alignment);
  const std::size_t bytes = boxes_begin + 32 * nodes;
  grow(context_, cloud_buffer_, bytes, false);
  table_ = {cloud_buffer_.handle(), 0, 16 * table.size()};
  sorted_ = {cloud_buffer_.handle(), sorted_begin, 16 * points};
  boxes_ = {cloud_buffer_.handle(), boxes_begin, 32 * nodes};

  const Buffer staging(context_, bytes, true);
  std::memcpy(staging.data(), table.data(), table_.size);
  for (std::size_t i = 0; i < clouds_.size(); ++i) {
    const Cloud& cloud = clouds_[i];
    std::memcpy(staging.data() + sorted_begin + 16 * table[i][0], cloud.sorted.data(),
                16 * cloud.sorted.size());
    std::memcpy(staging.data() + boxes_begin + 32 * table[i][2], cloud.boxes.data(), 32 * cloud.boxes.size());
  }
  Schedule schedule;
  schedule.copy({staging.handle(), 0, bytes}, {cloud_buffer_.handle(), 0, bytes});
  submitter_.run(schedule);
  uploaded_ = clouds_.size();
}

void Nearest::lay_out(std::span<const Request> requests) {
  const std::size_t alignment = context_.capabilities().alignment;
  places_.assign(requests.size(), {});
  std::size_t rows = 0, tiles = 0;
  index_bytes_ = 0;
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    Group& group = groups_[g];
    group.rows = 0;
    group.tiles.clear();
    for (std::size_t r = 0; r < requests.size(); ++r) {
      const Request& request = requests[r];
      if (request.wanted != group.wanted) continue;
      places_[r] = {g, group.rows};
      const std::size_t end = group.rows + request.count;
      for (std::size_t row = group.rows; row < end; row += tile_rows)
        group.tiles.push_back({request.cloud, static_cast<std::uint32_t>(row),
                               static_cast<std::uint32_t>(std::min<std::size_t>(row + tile_rows, end)), 0});
      group.rows = end;
    }
    group.first_row = rows;
    group.first_tile = tiles;
    group.index_begin = index_bytes_;
    // Whole bindings.
    rows = aligned(rows + group.rows, alignment / 16);
    tiles = aligned(tiles + group.tiles.size(), alignment / 16);
    index_bytes_ = aligned(index_bytes_ + sizeof(std::uint32_t) * group.wanted * group.rows, alignment);
  }
  tile_bytes_ = 16 * tiles;
  query_bytes_ = 16 * rows;
  grow(context_, staging_, tile_bytes_ + query_bytes_, true);
  grow(context_, input_, tile_bytes_ + query_bytes_, false);
  grow(context_, index_, index_bytes_, false);
  grow(context_, readback_, index_bytes_, true);
  for (const Group& group : groups_)
    std::memcpy(staging_.data() + 16 * group.first_tile, group.tiles.data(), 16 * group.tiles.size());
}

float* Nearest::queries(std::size_t request) const {
  const Place& place = places_[request];
  return reinterpret_cast<float*>(staging_.data() + tile_bytes_ +
                                  16 * (groups_[place.group].first_row + place.row));
}

void Nearest::run() {
  upload_clouds();
  const Capabilities& c = context_.capabilities();
  Schedule schedule(c.groups);
  const std::size_t bytes = tile_bytes_ + query_bytes_;
  schedule.copy({staging_.handle(), 0, bytes}, {input_.handle(), 0, bytes});
  const auto most_tiles = static_cast<std::uint32_t>(
      std::clamp(most_cost / (search_cost * tile_rows), 1.0, static_cast<double>(c.groups)));
  for (const Group& group : groups_) {
    if (group.rows == 0) continue;
    const Range queries{input_.handle(), tile_bytes_ + 16 * group.first_row, 16 * group.rows};
    const Range tiles{input_.handle(), 16 * group.first_tile, 16 * group.tiles.size()};
    const Range index{index_.handle(), group.index_begin, sizeof(std::uint32_t) * group.wanted * group.rows};
    for (std::uint32_t first = 0; first < group.tiles.size(); first += most_tiles) {
      const std::uint32_t count =
          std::min(most_tiles, static_cast<std::uint32_t>(group.tiles.size()) - first);
      schedule.dispatch(group.pipeline, {queries, tiles, table_, sorted_, boxes_, index},
                        TileParameters{first}, {count, 1, 1}, search_cost * tile_rows * count);
    }
  }
  schedule.copy({index_.handle(), 0, index_bytes_}, {readback_.handle(), 0, index_bytes_});
  submitter_.run(schedule);
}

const std::uint32_t* Nearest::found(std::size_t request) const {
  const Place& place = places_[request];
  const Group& group = groups_[place.group];
  return reinterpret_cast<const std::uint32_t*>(readback_.data() + group.index_begin) +
         group.wanted * place.row;
}

}  // namespace bitr::vk
