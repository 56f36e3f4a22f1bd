// A whole folded network on the test's Vulkan device.
#pragma once

#include "model/build.hpp"
#include "support/cloud_batch.hpp"
#include "support/configurations.hpp"
#include "support/vulkan.hpp"

namespace bitr::test {

struct VulkanNetwork {
  ModelConfig config;
  graph::Graph graph;
  Random random{42};  ///< its own: clouds do not depend on the tests before
  CloudBatch batch;

  VulkanNetwork(const std::vector<std::array<std::size_t, 2>>& pairs, const ModelConfig& c = {})
      : config(c),
        graph(model::fold(model::build_graph(perturbed_weights(c, 3), Mode::scale_exact))),
        batch(random, pairs) {}

  graph::BatchLayout layout() const { return batch.layout(config.num_key_points); }
  vk::Capacity capacity() const {
    const auto rows = layout();
    return {rows.pairs(), rows.rows(graph::Rows::point), rows.key_points};
  }
  void fill(graph::Executor& executor) const { batch.fill(executor); }
  std::vector<float> run(graph::Executor& executor) const {
    batch.run(executor, config.num_key_points);
    return executor.read<float>(graph::Output::pose);
  }
};

#define BITR_NEEDS_VULKAN() \
  if (!test::vulkan()) GTEST_SKIP() << "no Vulkan device"

}  // namespace bitr::test
