#include "cpu/executor.hpp"

#include <chrono>
#include <cstdint>
#include <cstring>

#include "core/aligned.hpp"

namespace bitr::cpu {
namespace {

// As a number it is NaN in either type, so that what nobody wrote does not pass for zero.
constexpr std::byte guard_pattern{0xff};

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
Executor<T>::Executor(graph::Graph graph, ThreadPool& pool, const ExecutorOptions& options)
    : pool_(pool), options_(options) {
  replace(std::move(graph));
}

template <class T>
void Executor<T>::replace(graph::Graph graph) {
  graph_ = std::move(graph);
  kernels_.clear();
  for (const graph::Node& node : graph_.nodes) kernels_.push_back(kernel_for<T>(node.op));
  milliseconds_.resize(graph_.nodes.size());
  starts_.resize(graph_.nodes.size());
}

template <class T>
void Executor<T>::prepare(const graph::BatchLayout& layout) {
  layout_ = layout;
  slots_.clear();
  sizes_.clear();
  std::vector<std::size_t> guarded;
  for (const graph::TensorInfo& info : graph_.tensors) {
    slots_.push_back({nullptr, info.rows, info.per_row, info.width});
    sizes_.push_back(layout.rows(info.rows) * slots_.back().stride() *
                     (info.kind == graph::ElementKind::index ? sizeof(std::uint32_t) : sizeof(T)));
    guarded.push_back(sizes_.back() + options_.guard_bytes);
  }
  const graph::MemoryPlan plan =
      graph::plan_memory(graph_, guarded, options_.retain || options_.guard_bytes > 0);
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
  if (options_.guard_bytes > 0) std::fill_n(arena_.get(), arena_bytes_, guard_pattern);
}

template <class T>
void Executor<T>::run() {
  using Clock = std::chrono::steady_clock;
  const auto milliseconds = [](Clock::duration time) {
    return std::chrono::duration<double, std::milli>(time).count();
  };
  const auto first = Clock::now();
  std::vector<Slot> in, out;
  for (std::size_t i = 0; i < graph_.nodes.size(); ++i) {
    const auto start = Clock::now();
    const graph::Node& node = graph_.nodes[i];
    in.clear();
    out.clear();
    for (graph::TensorId id : node.inputs) in.push_back(slots_[id]);
    for (graph::TensorId id : node.outputs) out.push_back(slots_[id]);
    kernels_[i]->run({pool_, layout_, in, out});
    starts_[i] = milliseconds(start - first);
    milliseconds_[i] = milliseconds(Clock::now() - start);
  }
}

template <class T>
bool Executor<T>::guards_hold() const {
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    const auto* guard = static_cast<const std::byte*>(slots_[i].data) + sizes_[i];
    if (std::any_of(guard, guard + options_.guard_bytes,
                    [](std::byte byte) { return byte != guard_pattern; }))
      return false;
  }
  return true;
}

template <class T>
graph::TensorView Executor<T>::view(graph::TensorId id) const {
  using Number = graph::TensorView::Number;
  const graph::TensorInfo& info = graph_.tensors[id];
  const std::size_t width = static_cast<std::size_t>(info.width);
  const Number number = info.kind == graph::ElementKind::index ? Number::u32
                        : std::is_same_v<T, float>             ? Number::f32
                                                               : Number::f64;
  return {slots_[id].data, number, layout_.rows(info.rows) * static_cast<std::size_t>(info.per_row), width,
          width};
}

template class Executor<float>;
template class Executor<double>;

}  // namespace bitr::cpu
