// A graph made ready to run: one face for the CPU, in float or double, and for Vulkan.
#pragma once

#include <algorithm>
#include <concepts>
#include <ranges>
#include <span>
#include <string>
#include <vector>

#include "core/failure.hpp"
#include "graph/counters.hpp"
#include "graph/graph.hpp"

namespace bitr::graph {

/// A tensor where the host can reach it: `entries` times `width` numbers, `stride` numbers apart.
struct TensorView {
  enum class Number : std::uint8_t { f32, f64, u32 };
  void* data = nullptr;
  Number number = Number::f32;
  std::size_t entries = 0, width = 1, stride = 1;

  std::size_t size() const { return entries * width; }
  /// visit(float*), visit(double*) or visit(std::uint32_t*).
  template <class Visit>
  void visit(Visit visit) const {
    switch (number) {
      case Number::f32:
        return visit(static_cast<float*>(data));
      case Number::f64:
        return visit(static_cast<double*>(data));
      case Number::u32:
        return visit(static_cast<std::uint32_t*>(data));
    }
  }
};

/// Belongs to one thread at a time. Everything here may throw Failure.
class Executor {
 public:
  Executor() = default;
  Executor(const Executor&) = delete;
  Executor& operator=(const Executor&) = delete;
  virtual ~Executor() = default;

  /// Lays out a batch.
  virtual void prepare(const BatchLayout& layout) = 0;
  /// After prepare(): runs the batch and waits for it.
  virtual void run() = 0;
  /// Other constants for the same operations: `graph` differs in nothing but them and in how wide the tensors
  /// are that hold their gradients. Before the next prepare().
  virtual void replace(Graph graph) = 0;

  virtual const Graph& graph() const = 0;
  virtual const BatchLayout& layout() const = 0;
  virtual std::size_t workspace_bytes() const = 0;
  /// What the last run asked of the device.
  virtual Counters counters() const { return {}; }
  /// Milliseconds per node of the last run; zeros where the device has no clock.
  virtual const std::vector<double>& node_milliseconds() const = 0;
  /// Where each node begins, in milliseconds since the first one began.
  virtual const std::vector<double>& node_starts() const = 0;
  /// False if a kernel wrote behind a tensor, as far as guards were asked for.
  virtual bool guards_hold() const = 0;

  /// After prepare(), before run(): where a tensor that no node makes is to be written, padding included.
  virtual TensorView input(TensorId id) const = 0;
  /// After run(): where a readable tensor is, until the executor is used again.
  virtual TensorView output(TensorId id) const = 0;

  /// Fills an input from its rows, tight, in whatever type.
  template <std::ranges::contiguous_range Numbers>
  void write(TensorId id, const Numbers& numbers) {
    const std::span from(std::ranges::data(numbers), std::ranges::size(numbers));
    const TensorView to = input(id);
    check_size(id, to, from.size());
    to.visit(
        [&]<class T>(T* at) { spread(from, to, checked<T, std::ranges::range_value_t<Numbers>>(id, at)); });
  }
  template <std::ranges::contiguous_range Numbers>
  void write(Input role, const Numbers& numbers) {
    write(graph().input(role), numbers);
  }
  /// A tensor's rows, tight. `to` has as many numbers as the tensor.
  template <class T>
  void read(TensorId id, std::span<T> to) const {
    const TensorView from = output(id);
    check_size(id, from, to.size());
    from.visit([&]<class U>(U* at) { gather(checked<U, T>(id, at), from, to); });
  }
  template <class T>
  std::vector<T> read(TensorId id) const {
    const TensorView from = output(id);
    std::vector<T> numbers(from.size());
    from.visit([&]<class U>(U* at) { gather(checked<U, T>(id, at), from, std::span(numbers)); });
    return numbers;
  }
  template <class T>
  void read(Output role, std::span<T> to) const {
    read(graph().output(role), to);
  }
  template <class T>
  std::vector<T> read(Output role) const {
    return read<T>(graph().output(role));
  }

 private:
  [[noreturn]] void refuse(TensorId id, const std::string& what) const {
    throw Failure(ErrorCode::internal, graph().tensors[id].name + ": " + what);
  }
  void check_size(TensorId id, const TensorView& view, std::size_t size) const {
    if (size != view.size())
      refuse(id, std::to_string(size) + " numbers for a tensor of " + std::to_string(view.size()));
  }
  // Indices are no numbers.
  template <class Own, class Other>
  Own* checked(TensorId id, Own* at) const {
    if (std::integral<Own> != std::integral<Other>)
      refuse(id, std::integral<Own> ? "indices taken for numbers" : "numbers taken for indices");
    return at;
  }
  template <class From, class To>
  static void spread(std::span<From> from, const TensorView& view, To* to) {
    const auto cast = [](From x) { return static_cast<To>(x); };
    if (view.width == view.stride) {
      std::transform(from.begin(), from.end(), to, cast);
      return;
    }
    for (std::size_t row = 0; row < view.entries; ++row, to += view.stride)
      std::fill(std::transform(&from[row * view.width], &from[row * view.width] + view.width, to, cast),
                to + view.stride, To{0});
  }
  template <class From, class To>
  static void gather(const From* from, const TensorView& view, std::span<To> to) {
    const auto cast = [](From x) { return static_cast<To>(x); };
    if (view.width == view.stride) {
      std::transform(from, from + view.size(), to.begin(), cast);
      return;
    }
    auto at = to.begin();
    for (std::size_t row = 0; row < view.entries; ++row, from += view.stride)
      at = std::transform(from, from + view.width, at, cast);
  }
};

}  // namespace bitr::graph
