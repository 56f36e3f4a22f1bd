#include "graph/memory_plan.hpp"

#include <algorithm>
#include <numeric>

#include "core/aligned.hpp"

namespace bitr::graph {
namespace {

struct Lifetime {
  int first = -1;
  int last = -1;
  bool meets(const Lifetime& other) const { return first <= other.last && other.first <= last; }
};

std::vector<Lifetime> lifetimes(const Graph& graph, bool retain) {
  std::vector<Lifetime> lives(graph.tensors.size());
  const int end = static_cast<int>(graph.nodes.size());
  for (int i = 0; i < end; ++i) {
    for (TensorId id : graph.nodes[i].inputs) lives[id].last = std::max(lives[id].last, i);
    for (TensorId id : graph.nodes[i].outputs) lives[id] = {i, i};
  }
  for (TensorId id : graph.readable()) lives[id].last = end;
  if (retain)
    for (Lifetime& life : lives) life.last = end;
  return lives;
}

std::size_t arena_aligned(std::size_t bytes) { return aligned(bytes, arena_alignment); }

}  // namespace

MemoryPlan plan_memory(const Graph& graph, const std::vector<std::size_t>& sizes, bool retain) {
  const auto lives = lifetimes(graph, retain);
  std::vector<TensorId> order(graph.tensors.size());
  std::iota(order.begin(), order.end(), 0);
  // Largest first, each at the lowest offset that is free throughout its life.
  std::stable_sort(order.begin(), order.end(), [&](TensorId a, TensorId b) { return sizes[a] > sizes[b]; });

  MemoryPlan plan{std::vector<std::size_t>(graph.tensors.size(), 0), 0};
  std::vector<TensorId> placed;
  for (TensorId id : order) {
    std::vector<TensorId> neighbors;
    for (TensorId other : placed)
      if (lives[id].meets(lives[other])) neighbors.push_back(other);
    std::sort(neighbors.begin(), neighbors.end(),
              [&](TensorId a, TensorId b) { return plan.offset[a] < plan.offset[b]; });
    std::size_t at = 0;
    for (TensorId other : neighbors) {
      if (at + arena_aligned(sizes[id]) <= plan.offset[other]) break;
      at = std::max(at, plan.offset[other] + arena_aligned(sizes[other]));
    }
    plan.offset[id] = at;
    plan.bytes = std::max(plan.bytes, at + arena_aligned(sizes[id]));
    placed.push_back(id);
  }
  return plan;
}

}  // namespace bitr::graph
