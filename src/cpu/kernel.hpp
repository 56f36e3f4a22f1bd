// What every CPU kernel is: an operation made ready for one arithmetic type, run on slots of memory.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>

#include "core/thread_pool.hpp"
#include "graph/batch_layout.hpp"
#include "ops/op.hpp"

namespace bitr::cpu {

/// Eight edges, or eight points, at once; other widths where a row's edges are as many. Kernels that exchange
/// numbers between lanes, or keep many rows in registers, have cpu/pack.hpp instead.
constexpr int lane_count = 8;
template <class T, int count = lane_count>
using Lanes = Eigen::Array<T, count, 1>;
template <class T>
using RowMatrix = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// One tensor's memory.
struct Slot {
  void* data = nullptr;
  graph::Rows rows = graph::Rows::point;
  int per_row = 1;
  int width = 1;

  template <class T>
  T* as() const {
    return static_cast<T*>(data);
  }
  std::size_t stride() const { return static_cast<std::size_t>(per_row) * static_cast<std::size_t>(width); }
};

struct Arguments {
  ThreadPool& pool;
  const graph::BatchLayout& layout;
  std::span<const Slot> in;
  std::span<const Slot> out;

  std::size_t rows(const Slot& slot) const { return layout.rows(slot.rows); }
};

/// A gradient node's slots by what they mean (ops/gradient.hpp).
template <class Operation>
struct GradientSlots {
  const ops::Gradient<Operation>& op;
  const Arguments& args;

  const Slot& in(int i) const { return args.in[i]; }
  const Slot& out(int i) const { return args.in[op.inputs + i]; }
  /// The gradient of output i; nullptr where it is zero.
  const Slot* grad_output(int i) const {
    return op.grad_output_at(i) < 0 ? nullptr : &args.in[op.grad_output_at(i)];
  }
  /// Where the gradient of input i goes; nullptr where none is wanted.
  const Slot* grad_input(int i) const {
    return op.grad_input_at(i) < 0 ? nullptr : &args.out[op.grad_input_at(i)];
  }
  /// Where the gradient of the constants goes; nullptr where there are none.
  const Slot* constants() const { return op.constants ? &args.out[op.constants_at()] : nullptr; }
};

template <class T>
class Kernel {
 public:
  virtual ~Kernel() = default;
  virtual void run(const Arguments& args) const = 0;
};

template <class T>
using KernelPtr = std::unique_ptr<Kernel<T>>;

/// Defined for every operation of ops::Op but ops::AttentionLayer, in the file of its stem.
template <class T, class Operation>
KernelPtr<T> make_kernel(const Operation& op);

}  // namespace bitr::cpu
