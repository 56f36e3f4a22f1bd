// Plans on the device: replay, memory, threads.
#include <atomic>
#include <thread>

#include "support/golden.hpp"
#include "vk/count_new.hpp"
#include "vk/network.hpp"

namespace bitr {
namespace {

using test::VulkanNetwork;

TEST(Executor, ReplaysTheSameBits) {
  BITR_NEEDS_VULKAN();
  const VulkanNetwork network({{200, 90}, {25, 333}});
  vk::Executor executor(test::vulkan(), network.graph, network.capacity());
  const auto first = network.run(executor);
  EXPECT_EQ(network.run(executor), first);
  vk::Executor again(test::vulkan(), network.graph, network.capacity());
  EXPECT_EQ(network.run(again), first);
}

TEST(Executor, NothingIsAllocatedWhileRunning) {
  BITR_NEEDS_VULKAN();
  // Without validation layers, which allocate for every call.
  const auto device = std::make_shared<vk::Context>(vk::OwnDevice{});
  const VulkanNetwork network({{200, 90}});
  vk::Executor executor(device, network.graph, network.capacity());
  network.run(executor);
  const std::size_t device_allocations = device->allocations();
  executor.prepare(network.layout());
  network.fill(executor);
  const std::size_t before = test::allocations_of_this_thread();
  for (int i = 0; i < 3; ++i) executor.run();
  EXPECT_EQ(test::allocations_of_this_thread(), before) << "memory of the host's";
  EXPECT_EQ(device->allocations(), device_allocations) << "memory of the device's";
}

TEST(Executor, SmallerBatchesUseTheMemoryThatIsThere) {
  BITR_NEEDS_VULKAN();
  const VulkanNetwork large({{200, 90}, {25, 333}}), small({{40, 33}});
  vk::Executor executor(test::vulkan(), large.graph, large.capacity());
  const auto first = large.run(executor);
  const std::size_t allocations = test::vulkan()->allocations();
  const auto pose = small.run(executor);
  EXPECT_EQ(large.run(executor), first);
  EXPECT_EQ(test::vulkan()->allocations(), allocations);
  vk::Executor own(test::vulkan(), small.graph, small.capacity());
  EXPECT_EQ(small.run(own), pose);
}

TEST(Executor, APairAloneIsThePairInABatch) {
  BITR_NEEDS_VULKAN();
  const VulkanNetwork batch({{200, 90}, {25, 333}, {65, 64}});
  vk::Executor executor(test::vulkan(), batch.graph, batch.capacity());
  const auto poses = batch.run(executor);
  for (std::size_t pair = 0; pair < 3; ++pair) {
    VulkanNetwork alone({{25, 25}});
    alone.batch.clouds = {batch.batch.clouds[pair], batch.batch.clouds[3 + pair]};
    vk::Executor own(test::vulkan(), alone.graph, alone.capacity());
    const auto pose = alone.run(own);
    EXPECT_EQ(std::vector<float>(poses.begin() + 16 * pair, poses.begin() + 16 * (pair + 1)), pose);
  }
}

TEST(Executor, RefusesABatchBeyondItsCapacity) {
  BITR_NEEDS_VULKAN();
  const VulkanNetwork small({{40, 33}}), large({{200, 90}}), two({{25, 25}, {25, 25}});
  vk::Executor executor(test::vulkan(), small.graph, small.capacity());
  EXPECT_THROW(executor.prepare(large.layout()), Failure);
  EXPECT_THROW(executor.prepare(two.layout()), Failure);
  small.run(executor);
}

TEST(Executor, GrowsWithItsBatchesIfAsked) {
  BITR_NEEDS_VULKAN();
  const VulkanNetwork small({{40, 33}}), large({{200, 90}}), more({{25, 25}, {40, 33}, {30, 30}});
  vk::Executor executor(test::vulkan(), small.graph, small.capacity(), {.growth = 1.5});
  const auto first = small.run(executor);
  const std::size_t bytes = executor.workspace_bytes();
  for (const VulkanNetwork* network : {&large, &more}) {
    vk::Executor own(test::vulkan(), network->graph, network->capacity());
    EXPECT_EQ(network->run(executor), network->run(own));
  }
  EXPECT_GT(executor.workspace_bytes(), bytes);
  // What has held them all holds each of them, and half as many points again.
  const VulkanNetwork between({{280, 100}});
  const std::size_t allocations = test::vulkan()->allocations();
  EXPECT_EQ(small.run(executor), first);
  large.run(executor);
  more.run(executor);
  between.run(executor);
  EXPECT_EQ(test::vulkan()->allocations(), allocations);
}

// Two plans of two threads share the device, its queue and its pipelines.
TEST(Executor, ThreadsShareADevice) {
  BITR_NEEDS_VULKAN();
  const VulkanNetwork networks[] = {VulkanNetwork({{200, 90}}), VulkanNetwork({{33, 65}, {100, 40}})};
  std::vector<float> expected[2];
  for (int i = 0; i < 2; ++i) {
    vk::Executor executor(test::vulkan(), networks[i].graph, networks[i].capacity());
    expected[i] = networks[i].run(executor);
  }
  std::atomic<int> wrong{0};
  const auto work = [&](int i) {
    for (int round = 0; round < 3; ++round) {
      vk::Executor executor(test::vulkan(), networks[i].graph, networks[i].capacity());
      for (int pass = 0; pass < 4; ++pass) wrong += networks[i].run(executor) != expected[i];
    }
  };
  std::thread other(work, 1);
  work(0);
  other.join();
  EXPECT_EQ(wrong, 0);
}

// More rows than a grid has work groups along an axis on many devices, and neighbours through the tree.
TEST(Executor, SeventyThousandPoints) {
  BITR_NEEDS_VULKAN();
  const VulkanNetwork network({{70001, 300}});
  vk::Executor executor(test::vulkan(), network.graph, network.capacity());
  const auto pose = network.run(executor);
  ThreadPool pool(2);
  cpu::Executor<double> truth(network.graph, pool);
  network.batch.run(truth, network.config.num_key_points);
  const auto expected = truth.read<double>(graph::Output::pose);
  EXPECT_LE(rotation_error_degrees(test::pose_of(pose.data()), test::pose_of(expected.data())), 0.05);
  for (int i = 9; i < 12; ++i) EXPECT_NEAR(pose[i], expected[i], 1e-3);
}

TEST(Executor, TimestampsAreInOrder) {
  BITR_NEEDS_VULKAN();
  if (test::vulkan()->capabilities().timestamp_bits == 0) GTEST_SKIP() << "the device has no clock";
  const VulkanNetwork network({{200, 90}});
  vk::Executor executor(test::vulkan(), network.graph, network.capacity());
  network.run(executor);
  double last = 0, total = 0;
  for (std::size_t n = 0; n < executor.graph().nodes.size(); ++n) {
    EXPECT_GE(executor.node_starts()[n], last);
    EXPECT_GE(executor.node_milliseconds()[n], 0);
    last = executor.node_starts()[n];
    total += executor.node_milliseconds()[n];
  }
  EXPECT_GT(total, 0);
}

}  // namespace
}  // namespace bitr
