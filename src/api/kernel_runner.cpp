#include "api/kernel_runner.hpp"

#include <type_traits>

#include "core/failure.hpp"

namespace bitr {

template <class T>
KernelRunner<T>::KernelRunner(const Device& device, graph::Graph graph)
    : device_(device), graph_(std::move(graph)) {
  if (std::is_same_v<T, double> && device.backend() == Backend::vulkan)
    throw Failure(ErrorCode::unsupported, device.name() + " computes in float: double is for the CPU");
}

template <class T>
void KernelRunner<T>::run(const graph::BatchLayout& layout, std::span<const Numbers<T>> inputs,
                          Room<T> result) {
  constexpr Precision precision = std::is_same_v<T, double> ? Precision::f64 : Precision::f32;
  if (!executor_) executor_ = make_executor(device_, graph_, layout, {.precision = precision, .growth = 1});
  executor_->prepare(layout);
  for (std::size_t i = 0; i < inputs.size(); ++i)
    std::visit([&](const auto& numbers) { executor_->write(static_cast<graph::TensorId>(i), numbers); },
               inputs[i]);
  executor_->run();
  std::visit([&](const auto& room) { executor_->read(graph::Output::result, room); }, result);
}

template class KernelRunner<float>;
template class KernelRunner<double>;

}  // namespace bitr
