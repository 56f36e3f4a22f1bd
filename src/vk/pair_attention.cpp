#include <algorithm>

#include "core/failure.hpp"
#include "pair_attention.spv.hpp"
#include "vk/kernel.hpp"
#include "vk/pair_messages.hpp"

namespace bitr::vk {
namespace {

constexpr Access attention_bindings[] = {Access::read, Access::read, Access::read, Access::write};
constexpr Shader attention_shader{"pair_attention", spirv::pair_attention, attention_bindings,
                                  sizeof(PairParameters), 24};

constexpr std::uint32_t work_group = 32;
// Messages between the dispatches; a larger batch goes in several runs.
constexpr std::size_t most_scratch = std::size_t{32} << 20;

std::uint32_t number(int x) { return static_cast<std::uint32_t>(x); }

class PairAttentionKernel : public Kernel {
 public:
  PairAttentionKernel(const Site& site, const ops::PairAttention& op)
      : op_(without_tables(op)),
        k_(number(site.in[1].per_row)),
        capabilities_(site.context.capabilities()),
        messages_(site, op) {
    require_shared(4 * (k_ * number(op.heads) + number(op.heads) + number(op.key_fiber.size()) +
                        number(op.value_fiber.size()) + 2 * padded(op.fiber_out.size())));
    for (const std::uint32_t x : messages_.take_constants(0)) add_constant(x);
    weights_ = add_weights();
    make_pipeline(site.context);
  }

  std::size_t scratch_bytes(const graph::BatchLayout& layout) const override {
    const std::size_t nodes = std::min<std::size_t>(layout.rows(graph::Rows::pair_key), run_nodes());
    return rare_offset(nodes) + sizeof(std::uint32_t) * nodes * k_;
  }

  void record(const Arguments& args) const override {
    const auto nodes = static_cast<std::uint32_t>(args.layout.rows(graph::Rows::pair_key));
    for (std::uint32_t first = 0; first < nodes; first += run_nodes())
      record_run(args, {first, std::min(nodes - first, run_nodes())});
  }

 private:
  ConstantPart add_weights() {
    const VkDeviceSize offset = sizeof(std::uint32_t) * constants().size();
    for (const auto* matrices : {&op_.query, &op_.project, &op_.self})
      for (const auto& [d, matrix] : *matrices) add_constants(matrix);
    if (op_.relu)
      for (const auto& [d, plane] : op_.planes) add_constants(plane);
    return {offset, sizeof(std::uint32_t) * constants().size() - offset};
  }

  void make_pipeline(const Context& context) {
    auto sizes = messages_.layer_sizes(std::array{work_group, k_, number(op_.heads)});
    for (const irreps::Degree d : pair_degrees) sizes.push_back(number(op_.fiber_out.channels(d)));
    sizes.push_back(!op_.self.empty());
    sizes.push_back(op_.relu);
    sizes.push_back(op_.relu_square);
    attention_pipeline_ = &context.pipeline(attention_shader, sizes);
  }

  void record_run(const Arguments& args, const PairParameters& run) const {
    const Slot &features = args.in[0], &index = args.in[1], &positions = args.in[2];
    const std::uint32_t edges = run.nodes * k_;
    const Range run_index = index.range.sub(4ull * k_ * run.first_node, 4ull * edges);
    const Range messages = args.scratch.sub(0, 4ull * messages_.stride() * edges);
    const Range rare = args.scratch.sub(rare_offset(run.nodes), 4ull * edges);
    messages_.record(args, run, features.range, run_index, positions.range, messages, rare);
    args.schedule.dispatch(*attention_pipeline_,
                           {features.range, messages, weights_.of(args), args.out[0].range}, run,
                           {run.nodes, 1, 1}, 4.0 * messages_.stride() * edges);
  }

  // Nodes whose messages fit into the scratch memory, and whose edges into the grid; index rows stay aligned.
  std::uint32_t run_nodes() const {
    const std::size_t node_bytes = sizeof(float) * (messages_.stride() + 1) * k_;
    const std::size_t fit = std::min<std::size_t>(most_scratch / node_bytes, capabilities_.groups / k_);
    return static_cast<std::uint32_t>(std::max<std::size_t>(64, fit / 64 * 64));
  }
  std::size_t rare_offset(std::size_t nodes) const {
    return (sizeof(float) * messages_.stride() * nodes * k_ + 255) / 256 * 256;
  }

  const ops::PairAttention op_;
  const std::uint32_t k_;
  const Capabilities& capabilities_;
  PairMessages messages_;
  ConstantPart weights_;
  const Pipeline* attention_pipeline_ = nullptr;
};

}  // namespace

KernelPtr make_kernel(const Site& site, const ops::PairAttention& op) {
  return std::make_unique<PairAttentionKernel>(site, op);
}

}  // namespace bitr::vk
