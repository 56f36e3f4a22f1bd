// Runs one CPU kernel on memory with guards around every tensor.
#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <type_traits>
#include <variant>
#include <vector>

#include "cpu/kernel.hpp"
#include "graph/graph.hpp"

namespace bitr::test {

/// One tensor's shape and, for inputs, values.
struct OpTensor {
  graph::Rows rows = graph::Rows::point;
  int per_row = 1;
  int width = 1;
  bool index = false;
  std::vector<double> values;          ///< a real tensor's
  std::vector<std::uint32_t> indices;  ///< an index tensor's

  static OpTensor like(const graph::TensorInfo& info) {
    return {info.rows, info.per_row, info.width, info.kind == graph::ElementKind::index, {}, {}};
  }
};

/// A tensor's memory between two guards. What a kernel leaves unwritten stays NaN (or the largest index).
template <class T>
class GuardedTensor {
 public:
  GuardedTensor(const graph::BatchLayout& layout, const OpTensor& tensor)
      : tensor_(tensor),
        count_(layout.rows(tensor.rows) * tensor.per_row * tensor.width),
        bytes_(count_ * (tensor.index ? sizeof(std::uint32_t) : sizeof(T))),
        memory_(bytes_ + 2 * guard_size, guard_byte) {
    if (tensor.index) {
      auto* to = slot().template as<std::uint32_t>();
      for (std::size_t i = 0; i < count_; ++i) to[i] = tensor.indices.empty() ? ~0u : tensor.indices.at(i);
    } else {
      auto* to = slot().template as<T>();
      for (std::size_t i = 0; i < count_; ++i)
        to[i] =
            tensor.values.empty() ? std::numeric_limits<T>::quiet_NaN() : static_cast<T>(tensor.values.at(i));
    }
    before_ = memory_;
  }

  cpu::Slot slot() { return {memory_.data() + guard_size, tensor_.rows, tensor_.per_row, tensor_.width}; }
  bool guards_hold() const {
    return std::memcmp(memory_.data(), before_.data(), guard_size) == 0 &&
           std::memcmp(memory_.data() + guard_size + bytes_, before_.data() + guard_size + bytes_,
                       guard_size) == 0;
  }
  bool unchanged() const { return memory_ == before_; }
  OpTensor result() {
    OpTensor result = tensor_;
    if (tensor_.index) {
      const auto* from = slot().template as<std::uint32_t>();
      result.indices.assign(from, from + count_);
    } else {
      const auto* from = slot().template as<T>();
      result.values.assign(from, from + count_);
    }
    return result;
  }

 private:
  static constexpr std::size_t guard_size = 256;
  static constexpr std::byte guard_byte{0xa5};
  OpTensor tensor_;
  std::size_t count_, bytes_;
  std::vector<std::byte, Eigen::aligned_allocator<std::byte>> memory_, before_;
};

/// Runs `op` in T; expects guards and inputs untouched; returns the outputs.
template <class T>
std::vector<OpTensor> run_op(const ops::Op& op, const graph::BatchLayout& layout,
                             const std::vector<OpTensor>& inputs, const std::vector<OpTensor>& outputs,
                             ThreadPool& pool) {
  std::vector<GuardedTensor<T>> in, out;
  for (const OpTensor& tensor : inputs) in.emplace_back(layout, tensor);
  for (const OpTensor& tensor : outputs) out.emplace_back(layout, tensor);
  std::vector<cpu::Slot> in_slots, out_slots;
  for (auto& tensor : in) in_slots.push_back(tensor.slot());
  for (auto& tensor : out) out_slots.push_back(tensor.slot());
  std::visit(
      [&](const auto& concrete) {
        if constexpr (!std::is_same_v<std::decay_t<decltype(concrete)>, ops::AttentionLayer>)
          cpu::make_kernel<T>(concrete)->run({pool, layout, in_slots, out_slots});
        else
          ADD_FAILURE() << "a composite layer has no kernel";
      },
      op);
  std::vector<OpTensor> results;
  for (auto& tensor : in) EXPECT_TRUE(tensor.unchanged()) << "an input was written to";
  for (auto& tensor : out) {
    EXPECT_TRUE(tensor.guards_hold()) << "written outside an output";
    results.push_back(tensor.result());
  }
  return results;
}

}  // namespace bitr::test
