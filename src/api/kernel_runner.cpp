#include "api/kernel_runner.hpp"

#include <algorithm>
#include <cstring>
#include <optional>

#include "core/failure.hpp"
#include "cpu/executor.hpp"
#include "vk/executor.hpp"

namespace bitr {
namespace {

using graph::Rows;

template <class T>
class OnCpu : public KernelRunner<T> {
 public:
  OnCpu(const Device& device, graph::Graph graph) : device_(device), executor_(std::move(graph), false) {}

  void run(const graph::BatchLayout& layout, std::span<const Numbers<T>> inputs, Room<T> result) override {
    executor_.prepare(layout);
    for (std::size_t i = 0; i < inputs.size(); ++i)
      std::visit(
          [&]<class U>(std::span<const U> numbers) {
            std::copy(numbers.begin(), numbers.end(),
                      executor_.template data<U>(static_cast<graph::TensorId>(i)));
          },
          inputs[i]);
    executor_.run(device_.pool());
    std::visit(
        [&]<class U>(std::span<U> room) {
          std::copy_n(executor_.template data<U>(executor_.graph().output(graph::Output::result)),
                      room.size(), room.data());
        },
        result);
  }
  std::size_t workspace_bytes() const override { return executor_.workspace_bytes(); }

 private:
  const Device device_;
  cpu::Executor<T> executor_;
};

// The least layout that holds both, as the executor understands layouts: by their totals.
graph::BatchLayout joined(const graph::BatchLayout& a, const graph::BatchLayout& b) {
  graph::BatchLayout both;
  const std::size_t segments = std::max(a.clouds(), b.clouds());
  const auto total = [&](Rows rows) {
    return static_cast<std::uint32_t>(std::max(a.rows(rows), b.rows(rows)));
  };
  both.cloud_offset.assign(segments + 1, total(Rows::point));
  both.key_offset.assign(segments + 1, total(Rows::key));
  both.cloud_offset.front() = both.key_offset.front() = 0;
  return both;
}

bool holds(const graph::BatchLayout& capacity, const graph::BatchLayout& layout) {
  return layout.clouds() <= capacity.clouds() && layout.rows(Rows::point) <= capacity.rows(Rows::point) &&
         layout.rows(Rows::key) <= capacity.rows(Rows::key);
}

class OnVulkan : public KernelRunner<float> {
 public:
  OnVulkan(std::shared_ptr<const vk::Context> context, graph::Graph graph)
      : context_(std::move(context)), graph_(std::move(graph)) {}

  void run(const graph::BatchLayout& layout, std::span<const Numbers<float>> inputs,
           Room<float> result) override {
    if (!executor_ || !holds(capacity_, layout)) {
      const graph::BatchLayout larger = joined(capacity_, layout);
      executor_.reset();  // before the new one takes memory
      executor_.emplace(context_, graph_, larger);
      capacity_ = larger;
    }
    executor_->prepare(layout);
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      const auto id = static_cast<graph::TensorId>(i);
      float* to = executor_->input(id);
      if (const auto* indices = std::get_if<std::span<const std::uint32_t>>(&inputs[i]))
        std::memcpy(to, indices->data(), indices->size_bytes());
      else
        spread(std::get<std::span<const float>>(inputs[i]), graph_.tensors[id].width, to);
    }
    executor_->run();
    std::visit(
        [&]<class U>(std::span<U> room) {
          if constexpr (std::is_same_v<U, float>)
            std::ranges::copy(executor_->real(graph_.output(graph::Output::result)), room.begin());
          else
            std::ranges::copy(executor_->indices(graph_.output(graph::Output::result)), room.begin());
        },
        result);
  }
  std::size_t workspace_bytes() const override { return executor_ ? executor_->workspace_bytes() : 0; }

 private:
  static void spread(std::span<const float> numbers, int width, float* to) {
    const std::size_t count = static_cast<std::size_t>(width), stride = vk::padded(width);
    if (count == stride) {
      std::ranges::copy(numbers, to);
      return;
    }
    for (std::size_t at = 0; at < numbers.size(); at += count, to += stride)
      std::fill(std::copy_n(numbers.data() + at, count, to), to + stride, 0.0F);
  }

  const std::shared_ptr<const vk::Context> context_;
  const graph::Graph graph_;
  graph::BatchLayout capacity_;
  std::optional<vk::Executor> executor_;
};

}  // namespace

template <class T>
std::unique_ptr<KernelRunner<T>> make_kernel_runner(const Device& device, graph::Graph graph) {
  if (device.backend() == Backend::cpu) return std::make_unique<OnCpu<T>>(device, std::move(graph));
  if constexpr (std::is_same_v<T, float>)
    return std::make_unique<OnVulkan>(device.context(), std::move(graph));
  else
    throw Failure(ErrorCode::unsupported, device.name() + " computes in float: double is for the CPU");
}
template std::unique_ptr<KernelRunner<float>> make_kernel_runner(const Device&, graph::Graph);
template std::unique_ptr<KernelRunner<double>> make_kernel_runner(const Device&, graph::Graph);

}  // namespace bitr
