#include "cpu/executor.hpp"

#include <chrono>
#include <cstdint>

#include "core/aligned.hpp"

namespace bitr::cpu {
namespace {

template <class T>
KernelPtr<T> kernel_for(const ops::Op& op) {
  return std::visit(
      [](const auto& concrete) -> KernelPtr<T> {
        if constexpr (std::is_same_v<std::decay_t<decltype(concrete)>, ops::AttentionLayer>)
          return nullptr;  // check_executable() has refused it
        else
          return make_kernel<T>(concrete);
      },
      op);
}

}  // namespace

template <class T>
Executor<T>::Executor(graph::Graph graph, bool retain) : retain_(retain) {
  replace(std::move(graph));
}

template <class T>
void Executor<T>::replace(graph::Graph graph) {
  graph_ = std::move(graph);
  kernels_.clear();
  for (const graph::Node& node : graph_.nodes) kernels_.push_back(kernel_for<T>(node.op));
  milliseconds_.resize(graph_.nodes.size());
}

template <class T>
void Executor<T>::prepare(const graph::BatchLayout& layout) {
  layout_ = layout;
  slots_.clear();
  std::vector<std::size_t> sizes;
  for (const graph::TensorInfo& info : graph_.tensors) {
    slots_.push_back({nullptr, info.rows, info.per_row, info.width});
    sizes.push_back(layout.rows(info.rows) * slots_.back().stride() *
                    (info.kind == graph::ElementKind::index ? sizeof(std::uint32_t) : sizeof(T)));
  }
  const graph::MemoryPlan plan = graph::plan_memory(graph_, sizes, retain_);
  if (const std::size_t needed = plan.bytes + graph::arena_alignment; arena_bytes_ < needed) {
    arena_bytes_ = 0;
    arena_.reset();  // before the new one is taken
    arena_ = std::make_unique_for_overwrite<std::byte[]>(needed);
    arena_bytes_ = needed;
  }
  auto base = reinterpret_cast<std::uintptr_t>(arena_.get());
  base = aligned(base, graph::arena_alignment);
  for (std::size_t i = 0; i < slots_.size(); ++i)
    slots_[i].data = reinterpret_cast<void*>(base + plan.offset[i]);
}

template <class T>
void Executor<T>::run(ThreadPool& pool) {
  using Clock = std::chrono::steady_clock;
  std::vector<Slot> in, out;
  for (std::size_t i = 0; i < graph_.nodes.size(); ++i) {
    const auto start = Clock::now();
    const graph::Node& node = graph_.nodes[i];
    in.clear();
    out.clear();
    for (graph::TensorId id : node.inputs) in.push_back(slots_[id]);
    for (graph::TensorId id : node.outputs) out.push_back(slots_[id]);
    kernels_[i]->run({pool, layout_, in, out});
    milliseconds_[i] = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
  }
}

template class Executor<float>;
template class Executor<double>;

}  // namespace bitr::cpu
