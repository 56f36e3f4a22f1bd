#include "api/runner.hpp"
#include "vk/executor.hpp"

namespace bitr {
namespace {

class VulkanRunner : public Runner {
 public:
  VulkanRunner(std::shared_ptr<const vk::Context> context, graph::Graph graph, const vk::Capacity& capacity,
               bool retain)
      : executor_(std::move(context), std::move(graph), capacity, {.retain = retain}) {}

  void run(const PackedBatch& batch, ThreadPool&) override {
    executor_.prepare(batch.layout);
    fill_inputs(batch, executor_.graph(), vk::padded(3),
                [&](graph::TensorId id) { return executor_.input(id); });
    executor_.run();
  }
  std::vector<double> tensor(graph::TensorId id) const override {
    const std::vector<float> numbers = executor_.real(id);
    return {numbers.begin(), numbers.end()};
  }
  std::vector<std::uint32_t> indices(graph::TensorId id) const override { return executor_.indices(id); }
  const graph::Graph& graph() const override { return executor_.graph(); }
  std::size_t workspace_bytes() const override { return executor_.workspace_bytes(); }
  std::vector<double> node_milliseconds() const override { return executor_.node_milliseconds(); }
  std::vector<double> node_starts() const override { return executor_.node_starts(); }
  PlanCounters counters() const override {
    const vk::Counters& c = executor_.counters();
    return {c.dispatches, c.copies, c.barriers, c.submissions};
  }
  vk::Executor* vulkan() override { return &executor_; }

 private:
  vk::Executor executor_;
};

}  // namespace

std::unique_ptr<Runner> make_vulkan_runner(std::shared_ptr<const vk::Context> context, graph::Graph graph,
                                           const BatchShape& capacity, int key_points, bool retain) {
  return std::make_unique<VulkanRunner>(
      std::move(context), std::move(graph),
      vk::Capacity{capacity.pairs, capacity.points, static_cast<std::uint32_t>(key_points)}, retain);
}

}  // namespace bitr
