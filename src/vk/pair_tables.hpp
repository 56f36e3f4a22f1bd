// The constants of pair_messages.comp and pair_networks.comp: radial tables and networks of a two-sided
// layer.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "ops/pair_attention.hpp"

namespace bitr::vk {

/// (0,0), (0,1), (1,0), (1,1): the degrees of every two-sided fiber.
constexpr std::array<irreps::Degree, 4> pair_degrees = {{{0, 0}, {0, 1}, {1, 0}, {1, 1}}};

/// As shaders/common/pair_layer.glsl numbers the tables and pair_tables.glsl reads them.
struct PairTables {
  bool linear = false;       ///< values and keys are computed apart
  std::uint32_t tables = 0;  ///< 20, or 40 if so
  std::uint32_t search = 6;  ///< every table has fewer than 2^search rays; the same for most layers
  /// Numbers as the shaders see them, each list padded to multiples of 64.
  std::vector<std::uint32_t> heads, rays, sectors;
};

/// Throws Failure (`unsupported`) for a layer without the blocks of all four degrees.
PairTables pack_pair_tables(const ops::PairAttention& op);

/// All but the radial tables, which are most of a layer and of no use once packed.
ops::PairAttention without_tables(const ops::PairAttention& op);

}  // namespace bitr::vk
