// What every Vulkan kernel is: an operation made ready for one device, put into a schedule.
#pragma once

#include <memory>
#include <span>
#include <type_traits>
#include <vector>

#include "graph/graph.hpp"
#include "ops/op.hpp"
#include "vk/parameters.hpp"
#include "vk/schedule.hpp"

namespace bitr::vk {

/// Rows of a segment (cloud or pair) that one work group takes; also its size.
constexpr std::uint32_t tile_rows = 32;

/// A size, count or flag as shaders take it.
template <class Integer>
constexpr std::uint32_t number(Integer x) {
  return static_cast<std::uint32_t>(x);
}

/// Numbers of a row are padded to whole vec4s, so that a shader may read any tensor either way.
constexpr std::uint32_t padded(int width) { return (static_cast<std::uint32_t>(width) + 3) / 4 * 4; }

/// One tensor's memory.
struct Slot {
  Range range;
  graph::Rows rows = graph::Rows::point;
  int per_row = 1;
  int width = 1;
};

/// The rows of one kind on the device.
struct RowTable {
  Range tiles;    ///< uvec4 per tile: segment, first row, row past the last, tile within the segment
  Range offsets;  ///< u32 per segment, and one: first row
  std::vector<std::array<std::uint32_t, 4>> host_tiles;
};

struct Tables {
  RowTable point, key, pair_key;
  const RowTable& of(graph::Rows rows) const {
    return rows == graph::Rows::point ? point : rows == graph::Rows::key ? key : pair_key;
  }
};

struct Arguments {
  Schedule& schedule;
  const graph::BatchLayout& layout;
  const Tables& tables;
  Range constants;  ///< this kernel's
  Range scratch;    ///< this kernel's
  Range saved;      ///< what an operation leaves for its gradient; empty: nothing
  Range lists;      ///< shared edge lists of listed_input(); empty when no kernel has built them yet
  bool make_lists;  ///< this kernel is the one to
  std::span<const Slot> in;
  std::span<const Slot> out;
};

/// A gradient node's memory by what it means (ops/gradient.hpp).
template <class Operation>
struct GradientSlots {
  const ops::Gradient<Operation>& op;
  const Arguments& args;

  const Range& in(int i) const { return args.in[i].range; }
  const Range& out(int i) const { return args.in[op.inputs + i].range; }
  bool has_grad_output(int i) const { return op.grad_output_at(i) >= 0; }
  bool needs_input_grad(int i) const { return op.grad_input_at(i) >= 0; }
  /// The gradient of output i; where it is zero, the output itself, to have something to bind.
  const Range& grad_output(int i) const {
    return has_grad_output(i) ? args.in[op.grad_output_at(i)].range : out(i);
  }
  /// Where the gradient of input i goes; where none is wanted, scratch memory.
  const Range& grad_input(int i) const {
    return needs_input_grad(i) ? args.out[op.grad_input_at(i)].range : args.scratch;
  }
  const Range& constants() const { return op.constants ? args.out[op.constants_at()].range : args.scratch; }
};

class Kernel {
 public:
  virtual ~Kernel() = default;
  /// Bytes of memory needed while it runs, for a batch of this layout.
  virtual std::size_t scratch_bytes(const graph::BatchLayout&) const { return 0; }
  /// Bytes it leaves for the gradient of its operation, if the graph has that (KernelContext::saved).
  virtual std::size_t saved_bytes(const graph::BatchLayout&) const { return 0; }
  /// Input whose edges it needs in lists, which kernels share that need those of the same tensor and name;
  /// −1: none.
  virtual int listed_input() const { return -1; }
  virtual const char* list_name() const { return "reverse"; }  // reverse_neighbours.hpp
  virtual std::size_t list_bytes(const graph::BatchLayout&) const { return 0; }
  /// Adds its work to the schedule.
  virtual void record(const Arguments& arguments) const = 0;
  /// Read-only numbers, uploaded once.
  const std::vector<std::uint32_t>& constants() const { return constants_; }

 protected:
  void add_constant(double value);
  void add_constant(std::uint32_t value) { constants_.push_back(value); }
  void add_constants(const Eigen::MatrixXd& matrix);  ///< row-major
  /// Zeros up to a multiple of `count` numbers.
  void pad_constants(std::size_t count) {
    while (constants_.size() % count) constants_.push_back(0);
  }

 private:
  std::vector<std::uint32_t> constants_;
};

using KernelPtr = std::unique_ptr<Kernel>;

/// What a kernel may know when it is made.
struct KernelContext {
  const Context& context;
  std::vector<graph::TensorInfo> in, out;
  const graph::BatchLayout& largest;  ///< a batch with as many rows of every kind as there can be
  /// The graph also has the operation's gradient; of a gradient: its operation has left something for it.
  bool saved = false;
};

template <class Operation, class... Others>
constexpr bool is_any_of = (std::is_same_v<Operation, Others> || ...);
/// Operations that only the CPU runs: those of the network as it is defined, before it is folded.
template <class Operation>
constexpr bool only_on_cpu =
    is_any_of<Operation, ops::Attend, ops::AttentionLayer, ops::CloudSoftmax, ops::CloudSum, ops::Convolve,
              ops::EdgeGeometry, ops::ExtendFeatures, ops::Linear, ops::ProjectedRelu>;
template <class Operation>
constexpr bool only_on_cpu<ops::Gradient<Operation>> = only_on_cpu<Operation>;

/// Defined for every other operation of ops::Op, in the file of its stem.
template <class Operation>
KernelPtr make_kernel(const KernelContext& site, const Operation& op);

/// Throws Failure (`unsupported`) for an operation that only the CPU runs.
KernelPtr kernel_for(const KernelContext& site, const ops::Op& op);

/// Runs of tiles whose dispatch costs at most the schedule's bound and fits into one axis of the grid, and
/// whose rows of `row_bytes`, with `beyond` more after their last, fit into one binding.
struct TileRun {
  std::uint32_t first, count;
  /// Rows the run touches: from a multiple of 64, so that bindings stay aligned, to past its last.
  std::uint32_t first_row, end_row;
};
std::vector<TileRun> tile_runs(const RowTable& table, const Capabilities& capabilities, double cost_per_row,
                               std::size_t row_bytes = 0, std::size_t beyond = 0);

/// The part of an index tensor that a run of tiles touches.
Range rows_of(const Slot& index, const TileRun& run);
/// The same for any tensor with rows of so many bytes, with up to `beyond` rows after the run's last.
Range rows_of(const Range& rows, std::size_t row_bytes, const TileRun& run, std::size_t beyond = 0);

/// Rows that kernels without tiles take in one dispatch.
struct RowRun {
  std::size_t first, count;
  /// Their part of a tensor that has `rows` rows.
  Range of(const Slot& slot, std::size_t rows) const {
    const VkDeviceSize row = slot.range.size / rows;
    return slot.range.sub(first * row, count * row);
  }
};
/// Runs that cost at most the schedule's bound and have at most `most_rows` rows, a multiple of 64 that keeps
/// bindings aligned.
std::vector<RowRun> row_runs(std::size_t rows, std::size_t most_rows, double cost_per_row);

/// Floating-point operations that one dispatch may take: about half a second of the slowest device here.
constexpr double most_cost = 2e10;

}  // namespace bitr::vk
