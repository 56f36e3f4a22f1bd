#pragma once

#include <cstddef>

namespace bitr::graph {

/// What one run asks of a Vulkan device; zeros on the CPU.
struct Counters {
  std::size_t dispatches = 0, copies = 0, barriers = 0, submissions = 0;
};

}  // namespace bitr::graph
