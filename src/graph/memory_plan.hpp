// Where each tensor lives in one arena: tensors whose lifetimes do not meet share memory.
#pragma once

#include <cstddef>
#include <vector>

#include "graph/graph.hpp"

namespace bitr::graph {

constexpr std::size_t arena_alignment = 64;

struct MemoryPlan {
  std::vector<std::size_t> offset;  ///< per tensor, in bytes, multiples of arena_alignment
  std::size_t bytes = 0;            ///< the whole arena's
};

/// `sizes`: bytes per tensor. A tensor lives from the node that makes it (inputs: from the start) to the last
/// node that reads it (outputs: to the end); with `retain` all live to the end, so that every stage can be
/// looked at.
MemoryPlan plan_memory(const Graph& graph, const std::vector<std::size_t>& sizes, bool retain);

}  // namespace bitr::graph
