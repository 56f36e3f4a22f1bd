#include "vk/sinkhorn.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "sinkhorn.spv.hpp"
#include "sinkhorn_shuffle.spv.hpp"
#include "sinkhorn_stop.spv.hpp"
#include "transport_moments.spv.hpp"
#include "transport_moments_shuffle.spv.hpp"
#include "vk/kernel.hpp"
#include "vk/memory.hpp"

namespace bitr::vk {
namespace {

// Lanes of a work group, which takes a block.
constexpr std::uint32_t lanes = 64;
static_assert(lanes == Sinkhorn::block);

// Operations for a term of a row.
constexpr double term_cost = 30;
// Iterations between two looks at which plans have stopped.
constexpr std::uint32_t between_looks = 8;

// Potentials and slacks in two parts (shaders/common/transport_plan.glsl).
std::array<float, 2> parts_of(double value) {
  const double coarse = std::round(value * 1024) / 1024;
  return {static_cast<float>(coarse), static_cast<float>(value - coarse)};
}

}  // namespace

Sinkhorn::Sinkhorn(const Context& context) : context_(context), submitter_(context) {}

void Sinkhorn::lay_out(std::span<const Problem> problems, bool normals) {
  problems_.assign(problems.begin(), problems.end());
  normals_ = normals;
  places_.clear();
  rows_ = 0;
  std::vector<std::array<std::uint32_t, 4>> tiles[2];
  std::vector<std::array<std::uint32_t, 8>> plans;
  std::uint32_t largest = 0;
  const auto place = [&](std::uint32_t count, std::size_t side) {
    const std::uint32_t first = rows_;
    for (std::uint32_t row = first; row < first + count; row += block)
      tiles[side].push_back(
          {static_cast<std::uint32_t>(plans.size()), row, std::min(row + block, first + count), 0});
    rows_ = static_cast<std::uint32_t>(aligned(first + count, block));
    largest = std::max(largest, count);
    return first;
  };
  for (const Problem& problem : problems_) {
    const std::uint32_t source = place(problem.sources, 0), reference = place(problem.references, 1);
    places_.push_back({source, reference});
    const auto slack = parts_of(problem.slack);
    plans.push_back({source, source + problem.sources, reference, reference + problem.references,
                     std::bit_cast<std::uint32_t>(slack[0]), std::bit_cast<std::uint32_t>(slack[1]),
                     std::bit_cast<std::uint32_t>(static_cast<float>(problem.tolerance)), 0});
  }
  source_tiles_ = tiles[0].size();
  reference_tiles_ = tiles[1].size();
  tile_cost_ = term_cost * block * largest;

  std::size_t at = 0;
  const auto part = [&](std::size_t bytes) {
    const Part made{at, bytes};
    at += aligned(bytes, context_.capabilities().alignment);
    return made;
  };
  tiles_[0] = part(16 * source_tiles_);
  tiles_[1] = part(16 * reference_tiles_);
  plans_ = part(32 * plans.size());
  points_ = part(sizeof(float) * numbers_per_point() * rows_);
  boxes_ = part(32 * (rows_ / block));
  blocks_ = part(16 * (rows_ / block));
  states_ = part(16 * plans.size());
  potentials_ = {at, std::size_t{16} * rows_};
  uploaded_ = at + potentials_.bytes;
  all_potentials_ = part(2 * potentials_.bytes);
  moments_ = part(std::size_t{32} * rows_);

  grow(context_, staging_, uploaded_, true);
  grow(context_, arena_, at, false);
  grow(context_, readback_, potentials_.bytes + moments_.bytes + states_.bytes, true);
  std::memset(staging_.data(), 0, uploaded_);
  for (std::size_t side = 0; side < 2; ++side)
    std::memcpy(staging_.data() + tiles_[side].begin, tiles[side].data(), tiles_[side].bytes);
  std::memcpy(staging_.data() + plans_.begin, plans.data(), plans_.bytes);
  for (std::uint32_t row = 0; row < rows_; row += block)
    block_record(row)[0] = std::numeric_limits<float>::lowest();
}

float* Sinkhorn::points(std::uint32_t row) const {
  return reinterpret_cast<float*>(staging_.data() + points_.begin) + numbers_per_point() * row;
}
float* Sinkhorn::boxes(std::uint32_t row) const {
  return reinterpret_cast<float*>(staging_.data() + boxes_.begin) + 8 * (row / block);
}
float* Sinkhorn::block_record(std::uint32_t row) const {
  return reinterpret_cast<float*>(staging_.data() + blocks_.begin) + 4 * (row / block);
}

void Sinkhorn::set_potential(std::size_t problem, std::uint32_t reference, double value) {
  const std::uint32_t row = places_[problem].reference + reference;
  const auto parts = parts_of(value);
  std::memcpy(staging_.data() + potentials_.begin + 16 * row, parts.data(), sizeof parts);
  block_record(row)[0] = std::max(block_record(row)[0], parts[0] + parts[1]);
}

template <class Record>
void Sinkhorn::by_tiles(std::size_t tiles, const Record& record) const {
  const auto most = static_cast<std::uint32_t>(
      std::clamp(most_cost / tile_cost_, 1.0, static_cast<double>(context_.capabilities().groups)));
  for (std::uint32_t first = 0; first < tiles; first += most)
    record(first, std::min(most, static_cast<std::uint32_t>(tiles) - first));
}

void Sinkhorn::add_iteration(Schedule& schedule, std::uint32_t iteration) const {
  const auto& shader = context_.capabilities().shuffle ? shaders::sinkhorn_shuffle : shaders::sinkhorn;
  const auto stop = context_.pipeline(shaders::sinkhorn_stop, std::array{lanes});
  for (const std::size_t side : {0, 1}) {
    const auto balance =
        context_.pipeline(shader, std::array{lanes, std::uint32_t{normals_}, std::uint32_t{side == 0}});
    by_tiles(side == 0 ? source_tiles_ : reference_tiles_, [&](std::uint32_t first, std::uint32_t count) {
      schedule.dispatch(balance,
                        {on_device(points_), on_device(boxes_), on_device(tiles_[side]), on_device(plans_),
                         on_device(all_potentials_), on_device(blocks_), on_device(states_)},
                        SinkhornParameters{first, iteration, rows_}, {count, 1, 1}, tile_cost_ * count);
    });
    // The first iteration has nothing to be compared with, and the sources' side shows how the last one
    // ended.
    if (side == 0 && iteration > 2)
      for (std::uint32_t first = 0; first < problems_.size(); first += context_.capabilities().groups)
        schedule.dispatch(
            stop, {on_device(plans_), on_device(blocks_), on_device(states_)},
            SinkhornParameters{first, iteration, rows_},
            {std::min(context_.capabilities().groups, static_cast<std::uint32_t>(problems_.size()) - first),
             1, 1},
            static_cast<double>(rows_));
  }
}

void Sinkhorn::run(int most_iterations) {
  most_ = most_iterations;
  const auto most = static_cast<std::uint32_t>(most_iterations);
  const std::size_t states_at = potentials_.bytes + moments_.bytes;
  const Range states{readback_.handle(), states_at, states_.bytes};
  Schedule schedule(context_.capabilities().groups);
  schedule.copy({staging_.handle(), 0, uploaded_}, {arena_.handle(), 0, uploaded_});
  bool going = true;
  for (std::uint32_t iteration = 1; iteration <= most && going;) {
    for (std::uint32_t i = 0; i < between_looks && iteration <= most; ++i)
      add_iteration(schedule, iteration++);
    schedule.copy(on_device(states_), states);
    submitter_.run(schedule);
    schedule.clear();
    going = false;
    for (std::size_t p = 0; p < problems_.size(); ++p) going = going || iterations(p) == most_iterations;
  }
  const auto moments = context_.pipeline(
      context_.capabilities().shuffle ? shaders::transport_moments_shuffle : shaders::transport_moments,
      std::array{lanes, std::uint32_t{normals_}});
  by_tiles(source_tiles_, [&](std::uint32_t first, std::uint32_t count) {
    schedule.dispatch(
        moments,
        {on_device(points_), on_device(boxes_), on_device(tiles_[0]), on_device(plans_),
         on_device(all_potentials_), on_device(blocks_), on_device(states_), on_device(moments_)},
        SinkhornParameters{first, most, rows_}, {count, 1, 1}, tile_cost_ * count);
  });
  schedule.copy(on_device(potentials_), {readback_.handle(), 0, potentials_.bytes});
  schedule.copy(on_device(moments_), {readback_.handle(), potentials_.bytes, moments_.bytes});
  submitter_.run(schedule);
}

int Sinkhorn::iterations(std::size_t problem) const {
  std::uint32_t state[2];
  std::memcpy(state, readback_.data() + potentials_.bytes + moments_.bytes + 16 * problem, sizeof state);
  return state[0] ? static_cast<int>(state[1]) : most_;
}

const float* Sinkhorn::moments(std::size_t problem) const {
  return reinterpret_cast<const float*>(readback_.data() + potentials_.bytes) + 8 * places_[problem].source;
}

double Sinkhorn::potential(std::size_t problem, std::uint32_t reference) const {
  float parts[2];
  std::memcpy(parts, readback_.data() + 16 * (places_[problem].reference + reference), sizeof parts);
  return static_cast<double>(parts[0]) + static_cast<double>(parts[1]);
}

}  // namespace bitr::vk
