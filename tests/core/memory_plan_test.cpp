#include "graph/memory_plan.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/random.hpp"

namespace bitr::graph {
namespace {

struct Case {
  Graph graph;
  std::vector<std::size_t> sizes;
};

// Nodes with one to three inputs made earlier and one or two outputs.
Case random_case(Random& random) {
  Case c;
  const auto tensor = [&] {
    c.sizes.push_back(random.below(4) == 0 ? random.below(3) * 64 : random.below(100000));
    return c.graph.add({.name = std::to_string(c.sizes.size()), .fiber = {}});
  };
  std::vector<TensorId> made = {c.graph.inputs.set(Input::positions, tensor())};
  const std::uint64_t nodes = 1 + random.below(40);
  for (std::uint64_t n = 0; n < nodes; ++n) {
    std::vector<TensorId> in, out;
    for (std::uint64_t i = 0; i <= random.below(3); ++i) in.push_back(made[random.below(made.size())]);
    for (std::uint64_t i = 0; i <= random.below(2); ++i) out.push_back(tensor());
    made.insert(made.end(), out.begin(), out.end());
    c.graph.append("node", ops::ProjectPose{}, in, out);
  }
  c.graph.outputs.set(Output::key_points, made[random.below(made.size())]);
  c.graph.outputs.set(Output::pose, made.back());
  return c;
}

// Independent of the plan's own bookkeeping: the steps at which a tensor's memory must hold its values.
std::vector<bool> alive(const Case& c, TensorId id, bool retain) {
  const auto& nodes = c.graph.nodes;
  const auto has = [&](const std::vector<TensorId>& ids) {
    return std::find(ids.begin(), ids.end(), id) != ids.end();
  };
  std::size_t made = 0, last = 0;
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    if (has(nodes[n].outputs)) made = last = n;
    if (has(nodes[n].inputs)) last = n;
  }
  const bool to_the_end = retain || c.graph.outputs.holds(id);
  std::vector<bool> steps(nodes.size() + 1, false);
  for (std::size_t n = made; n <= (to_the_end ? nodes.size() : last); ++n) steps[n] = true;
  return steps;
}

TEST(MemoryPlan, TensorsThatLiveTogetherNeverOverlap) {
  Random random(1);
  for (int round = 0; round < 300; ++round) {
    const Case c = random_case(random);
    for (const bool retain : {false, true}) {
      const MemoryPlan plan = plan_memory(c.graph, c.sizes, retain);
      ASSERT_EQ(plan.offset.size(), c.sizes.size());
      std::size_t total = 0;
      for (std::size_t i = 0; i < c.sizes.size(); ++i) {
        EXPECT_EQ(plan.offset[i] % arena_alignment, 0u);
        EXPECT_LE(plan.offset[i] + c.sizes[i], plan.bytes);
        total += (c.sizes[i] + arena_alignment - 1) / arena_alignment * arena_alignment;
        for (std::size_t j = 0; j < i; ++j) {
          if (!c.sizes[i] || !c.sizes[j]) continue;
          const bool overlap =
              plan.offset[i] < plan.offset[j] + c.sizes[j] && plan.offset[j] < plan.offset[i] + c.sizes[i];
          if (!overlap) continue;
          const auto a = alive(c, static_cast<TensorId>(i), retain),
                     b = alive(c, static_cast<TensorId>(j), retain);
          for (std::size_t n = 0; n < a.size(); ++n)
            ASSERT_FALSE(a[n] && b[n]) << "step " << n << " of round " << round;
        }
      }
      EXPECT_LE(plan.bytes, total);
    }
  }
}

TEST(MemoryPlan, AChainNeedsTwoTensorsAtATime) {
  Graph graph;
  TensorId last = graph.add_input(Input::positions, {.name = "in", .fiber = {}});
  for (int i = 0; i < 20; ++i) {
    const TensorId next = graph.add({.name = std::to_string(i), .fiber = {}});
    graph.append("step", ops::ProjectPose{}, {last}, {next});
    last = next;
  }
  graph.outputs.set(Output::pose, last);
  const std::vector<std::size_t> sizes(21, 6400);
  EXPECT_EQ(plan_memory(graph, sizes, false).bytes, 2u * 6400);
  EXPECT_EQ(plan_memory(graph, sizes, true).bytes, 21u * 6400);
}

}  // namespace
}  // namespace bitr::graph
