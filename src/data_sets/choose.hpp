// Some of many.
#pragma once

#include <cstddef>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

#include "core/random.hpp"

namespace bitr::data {

/// 0 … size − 1, of which the first `count` are the beginning of a random order.
inline std::vector<std::uint32_t> choose(std::size_t size, std::size_t count, Random& random) {
  std::vector<std::uint32_t> order(size);
  std::iota(order.begin(), order.end(), 0u);
  for (std::size_t i = 0; i < count; ++i) std::swap(order[i], order[i + random.below(size - i)]);
  return order;
}

}  // namespace bitr::data
