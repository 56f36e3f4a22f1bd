// Barriers from memory: enough of them, none to spare, and any legal order gives the same bits.
#include "vk/network.hpp"

namespace bitr {
namespace {

using test::VulkanNetwork;

std::vector<std::vector<float>> every_tensor(const VulkanNetwork& network,
                                             const vk::ExecutorOptions& options) {
  vk::Executor executor(test::vulkan(), network.graph, network.capacity(), options);
  network.run(executor);
  std::vector<std::vector<float>> tensors;
  for (std::size_t i = 0; i < network.graph.tensors.size(); ++i)
    if (network.graph.tensors[i].kind == graph::ElementKind::real)
      tensors.push_back(executor.read<float>(static_cast<int>(i)));
  return tensors;
}

TEST(Schedule, BarriersAreEnough) {
  BITR_NEEDS_VULKAN();
  const VulkanNetwork network({{200, 90}, {25, 333}});
  EXPECT_EQ(every_tensor(network, {.retain = true}),
            every_tensor(network, {.retain = true, .barriers = vk::Barriers::after_all_work}));
}

// With memory shared between tensors there is more to get wrong, and only the outputs to look at.
TEST(Schedule, BarriersAreEnoughWhereTensorsShareMemory) {
  BITR_NEEDS_VULKAN();
  const VulkanNetwork network({{200, 90}, {25, 333}});
  vk::Executor plain(test::vulkan(), network.graph, network.capacity());
  vk::Executor careful(test::vulkan(), network.graph, network.capacity(),
                       {.barriers = vk::Barriers::after_all_work});
  EXPECT_EQ(network.run(plain), network.run(careful));
  EXPECT_LT(plain.counters().barriers, careful.counters().barriers);
}

TEST(Schedule, LegalOrdersGiveTheSameBits) {
  BITR_NEEDS_VULKAN();
  const VulkanNetwork network({{200, 90}, {25, 333}});
  const auto expected = every_tensor(network, {.retain = true});
  vk::Executor sharing(test::vulkan(), network.graph, network.capacity());
  const auto pose = network.run(sharing);
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    EXPECT_EQ(every_tensor(network, {.retain = true, .shuffle = seed}), expected) << "order " << seed;
    vk::Executor shuffled(test::vulkan(), network.graph, network.capacity(), {.shuffle = seed});
    EXPECT_EQ(network.run(shuffled), pose) << "order " << seed;
  }
}

TEST(Schedule, ManySubmissionsGiveTheSameBits) {
  BITR_NEEDS_VULKAN();
  const VulkanNetwork network({{200, 90}});
  vk::Executor one(test::vulkan(), network.graph, network.capacity());
  vk::Executor many(test::vulkan(), network.graph, network.capacity(), {.submission_cost = 1});
  EXPECT_EQ(network.run(one), network.run(many));
  EXPECT_EQ(one.counters().submissions, 1u);
  EXPECT_GE(many.counters().submissions, many.counters().dispatches);
}

TEST(Schedule, DispatchesDoNotGrowWithTheBatch) {
  BITR_NEEDS_VULKAN();
  for (const std::size_t pairs : {1, 3, 9}) {
    const VulkanNetwork network(std::vector<std::array<std::size_t, 2>>(pairs, {60, 41}));
    vk::Executor executor(test::vulkan(), network.graph, network.capacity());
    network.run(executor);
    EXPECT_LE(executor.counters().dispatches, 30u) << pairs << " pairs";
    // The graph is nearly a chain: what could run side by side does.
    EXPECT_LE(executor.counters().barriers, executor.counters().dispatches + 2) << pairs << " pairs";
  }
}

TEST(Schedule, RunsOfTilesRespectTheGridAndTheCost) {
  vk::Capabilities device;
  device.groups = 7;
  vk::RowTable table;
  for (std::uint32_t row = 0, i = 0; row < 1000; row += 32, ++i)
    table.host_tiles.push_back({0, row, std::min(row + 32, 1000u), i});
  std::uint32_t next = 0, end = 0;
  for (const vk::TileRun& run : vk::tile_runs(table, device, 1)) {
    EXPECT_EQ(run.first, next);
    EXPECT_LE(run.count, 7u);
    EXPECT_LE(run.first_row, table.host_tiles[run.first][1]);
    EXPECT_EQ(run.first_row % 64, 0u);
    next = run.first + run.count;
    end = run.end_row;
  }
  EXPECT_EQ(next, table.host_tiles.size());
  EXPECT_EQ(end, 1000u);
  device.groups = 65535;
  EXPECT_EQ(vk::tile_runs(table, device, 1).size(), 1u);
  EXPECT_EQ(vk::tile_runs(table, device, vk::most_cost).size(), table.host_tiles.size());
}

}  // namespace
}  // namespace bitr
