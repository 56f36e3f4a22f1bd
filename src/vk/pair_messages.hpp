// Messages of a two-sided layer on the device, shared by pair_attention and its gradient.
#pragma once

#include "vk/kernel.hpp"
#include "vk/pair_tables.hpp"

namespace bitr::vk {

/// How often so many lanes go round so many items.
constexpr std::uint32_t rounds(std::uint32_t items, std::uint32_t lanes) {
  return (items + lanes - 1) / lanes;
}

/// Part of a kernel's constants.
struct ConstantPart {
  VkDeviceSize offset = 0, bytes = 0;
  Range of(const Arguments& args) const { return args.constants.sub(offset, bytes); }
};

class PairMessages {
 public:
  /// Throws Failure (`unsupported`) for a layer that is too wide for the device.
  PairMessages(const KernelContext& site, const ops::PairAttention& op);

  /// Matrices of the layer's attention, by degree: query, project, self (if any), planes (if any).
  std::vector<Eigen::MatrixXd> weights() const;
  /// Radial tables for the kernel's constants, where they begin at `offset` bytes; to be asked for once.
  std::vector<std::uint32_t> take_constants(VkDeviceSize offset);
  const ConstantPart& heads() const { return heads_; }
  const ConstantPart& rays() const { return rays_; }
  const ConstantPart& sectors() const { return sectors_; }
  /// Specialization constants 0 … 16 of shaders that include common/pair_layer.glsl, from their first three.
  std::vector<std::uint32_t> layer_sizes(const std::array<std::uint32_t, 3>& first) const;
  /// 0 … 23 of those that go from messages to results, from their first.
  std::vector<std::uint32_t> attention_sizes(const std::array<std::uint32_t, 1>& first) const;

  std::uint32_t stride() const { return padded(fiber_.size()); }  ///< numbers of an edge's messages
  std::uint32_t in_vectors() const;  ///< vec4s that hold the input channels of any degree
  std::uint32_t tables() const { return tables_.tables; }
  bool linear() const { return tables_.linear; }
  bool on_processor() const { return capabilities_.type == VK_PHYSICAL_DEVICE_TYPE_CPU; }
  /// Bytes of so many nodes' messages.
  std::size_t bytes(std::size_t nodes) const { return sizeof(float) * stride() * k_ * nodes; }

  /// The run's edges in an order in which neighbours mostly share sectors. `order` and `keys`: two u32 per
  /// edge, the latter scratch memory.
  void record_order(const Arguments& args, const PairParameters& run, const Range& index,
                    const Range& positions, const Range& keys, const Range& order) const;
  /// The messages of the run's edges, after record_order(); `rare`: a u32 per edge, scratch memory.
  void record(const Arguments& args, const PairParameters& run, const Range& features, const Range& index,
              const Range& positions, const Range& order, const Range& messages, const Range& rare) const;

 private:
  void check_loops() const;
  void choose_network_edges();

  const ops::PairAttention op_;
  const std::uint32_t k_;
  const Capabilities& capabilities_;
  const irreps::Fiber fiber_;  // [values ; keys]
  PairTables tables_;
  ConstantPart heads_, rays_, sectors_;
  std::uint32_t network_edges_ = 1, network_lanes_ = 32;
  PipelineOf<PairParameters> order_pipeline_, message_pipeline_, network_pipeline_;
};

/// Throws Failure (`unsupported`) if a work group of a two-sided layer would take more than every device has.
void require_shared(std::uint32_t bytes);

}  // namespace bitr::vk
