#pragma once

#include <algorithm>
#include <cstddef>

namespace bitr::cpu {

/// Memory for partial sums of what tasks make, all of them together.
constexpr std::size_t most_sum_bytes = std::size_t{256} << 20;

/// How many tasks with a sum of `bytes` each are begun before their sums are added: several for every thread, lest all
/// wait for the slowest, as long as the sums fit.
constexpr std::size_t sums_at_once(std::size_t tasks, std::size_t threads, std::size_t bytes) {
  const std::size_t fitting = bytes == 0 ? tasks : std::max<std::size_t>(most_sum_bytes / bytes, 1);
  return std::min({tasks, 4 * threads, fitting});
}

}  // namespace bitr::cpu
