#include "train/vulkan_steps.hpp"

#include <algorithm>

namespace bitr::train {

bool VulkanSteps::holds(const graph::BatchLayout& layout) const {
  return executor_ && layout.pairs() <= pairs_ && layout.rows(graph::Rows::point) <= points_;
}

void VulkanSteps::run(graph::Graph graph, const PackedBatch& batch, std::span<const Truth> truths) {
  if (holds(batch.layout)) {
    executor_->replace(std::move(graph));
  } else {
    executor_.reset();
    pairs_ = std::max<std::size_t>(pairs_, batch.layout.pairs());
    // Batches of points that vary a little should not have to grow it again and again.
    points_ = std::max(points_, batch.layout.rows(graph::Rows::point) * 9 / 8);
    executor_.emplace(context_, std::move(graph), vk::Capacity{pairs_, points_, batch.layout.key_points});
  }
  executor_->prepare(batch.layout);
  fill_inputs(batch, executor_->graph(), vk::padded(3),
              [&](graph::TensorId id) { return executor_->input(id); });
  static_assert(vk::padded(ops::truth_width) == ops::truth_width);
  float* to = executor_->input(executor_->graph().input(graph::Input::truth));
  for (const Truth& truth : truths)
    to = std::transform(truth.begin(), truth.end(), to, [](double x) { return static_cast<float>(x); });
  executor_->run();
}

std::vector<double> VulkanSteps::numbers(graph::TensorId id) const {
  const std::vector<float> single = executor_->real(id);
  return {single.begin(), single.end()};
}

}  // namespace bitr::train
