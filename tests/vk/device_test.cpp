// Devices: the cache of pipelines, several at once, what is refused.
#include "vk/network.hpp"

namespace bitr {
namespace {

using test::VulkanNetwork;

vk::OwnDevice with_cache(std::span<const std::byte> cache) {
  vk::OwnDevice wanted;
  wanted.pipeline_cache = cache;
  return wanted;
}

TEST(VulkanDevice, KeepsItsPipelineCache) {
  BITR_NEEDS_VULKAN();
  const VulkanNetwork network({{40, 33}});
  const auto first = std::make_shared<vk::Context>(vk::OwnDevice{});
  vk::Executor executor(first, network.graph, network.capacity());
  const auto pose = network.run(executor);
  const std::vector<std::byte> cache = first->pipeline_cache();
  const auto second = std::make_shared<vk::Context>(with_cache(cache));
  vk::Executor again(second, network.graph, network.capacity());
  EXPECT_EQ(network.run(again), pose);
}

// A driver believes what its cache says, so nothing damaged or foreign may reach it.
TEST(VulkanDevice, IgnoresADamagedPipelineCache) {
  BITR_NEEDS_VULKAN();
  const std::vector<std::byte> cache = test::vulkan()->pipeline_cache();
  std::vector<std::vector<std::byte>> damaged = {
      {}, {std::byte{1}}, std::vector<std::byte>(5000, std::byte{0x5a})};
  for (const std::size_t at : {0ul, 8ul, 16ul, 24ul, 40ul, 60ul, cache.size() - 1}) {
    if (at >= cache.size()) continue;
    damaged.push_back(cache);
    damaged.back()[at] ^= std::byte{1};
  }
  if (!cache.empty()) {
    damaged.emplace_back(cache.begin(), cache.end() - 1);
    damaged.push_back(cache);
    damaged.back().push_back(std::byte{0});
  }
  for (const auto& blob : damaged) {
    const vk::Context context(with_cache(blob));
    EXPECT_FALSE(context.lost());
  }
}

TEST(VulkanDevice, SeveralInOneProcess) {
  BITR_NEEDS_VULKAN();
  const VulkanNetwork network({{40, 33}});
  std::vector<float> poses[2];
  {
    const auto a = std::make_shared<vk::Context>(vk::OwnDevice{}),
               b = std::make_shared<vk::Context>(vk::OwnDevice{});
    vk::Executor on_a(a, network.graph, network.capacity()), on_b(b, network.graph, network.capacity());
    poses[0] = network.run(on_a);
    poses[1] = network.run(on_b);
  }
  EXPECT_EQ(poses[0], poses[1]);
}

TEST(VulkanDevice, CreationAndDestructionLeaveNothingBehind) {
  BITR_NEEDS_VULKAN();
  for (int i = 0; i < 5; ++i) {
    const vk::Context context{vk::OwnDevice{}};
    EXPECT_EQ(context.pipeline_count(), 0u);
  }
}

}  // namespace
}  // namespace bitr
