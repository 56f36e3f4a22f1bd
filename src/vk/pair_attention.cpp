#include <algorithm>

#include "core/failure.hpp"
#include "pair_attention.spv.hpp"
#include "vk/kernel.hpp"
#include "vk/memory.hpp"
#include "vk/pair_messages.hpp"

namespace bitr::vk {
namespace {

constexpr std::uint32_t pair_attention_group = 32;
// Bytes of messages between the dispatches; a larger batch goes in several runs.
constexpr std::size_t most_pair_scratch = std::size_t{32} << 20;
// Bytes of messages saved for the gradient, which makes them again where there are more.
constexpr std::size_t most_pair_saved = std::size_t{64} << 20;

class PairAttentionKernel : public Kernel {
 public:
  PairAttentionKernel(const KernelContext& site, const ops::PairAttention& op)
      : op_(without_tables(op)),
        k_(number(site.in[1].per_row)),
        capabilities_(site.context.capabilities()),
        messages_(site, op),
        saves_(site.saved && messages_.bytes(site.largest.rows(graph::Rows::pair_key)) <= most_pair_saved),
        one_run_(site.largest.rows(graph::Rows::pair_key) <= run_nodes()) {
    require_shared(4 * (k_ * number(op.heads) + number(op.heads) + number(op.key_fiber.size()) +
                        number(op.value_fiber.size()) + 2 * padded(op.fiber_out.size())));
    for (const std::uint32_t x : messages_.take_constants(0)) add_constant(x);
    weights_ = add_weights();
    attention_pipeline_ = site.context.pipeline(shaders::pair_attention,
                                                messages_.attention_sizes(std::array{pair_attention_group}));
  }

  std::size_t scratch_bytes(const graph::BatchLayout& layout) const override {
    const std::size_t nodes = std::min<std::size_t>(layout.rows(graph::Rows::pair_key), run_nodes());
    return rare_offset(nodes) + 3 * edge_bytes(nodes, 2);
  }
  std::size_t saved_bytes(const graph::BatchLayout& layout) const override {
    return saves_ ? messages_.bytes(layout.rows(graph::Rows::pair_key)) : 0;
  }

  // All layers have the same order, if their edges go in one run.
  int listed_input() const override { return one_run_ ? 1 : -1; }
  const char* list_name() const override { return "order"; }
  std::size_t list_bytes(const graph::BatchLayout& layout) const override {
    return edge_bytes(layout.rows(graph::Rows::pair_key), 2);
  }

  void record(const Arguments& args) const override {
    const auto nodes = static_cast<std::uint32_t>(args.layout.rows(graph::Rows::pair_key));
    for (std::uint32_t first = 0; first < nodes; first += run_nodes())
      record_run(args, {first, std::min(nodes - first, run_nodes())});
  }

 private:
  ConstantPart add_weights() {
    const VkDeviceSize offset = sizeof(std::uint32_t) * constants().size();
    for (const Eigen::MatrixXd& matrix : messages_.weights()) add_constants(matrix);
    return {offset, sizeof(std::uint32_t) * constants().size() - offset};
  }

  void record_run(const Arguments& args, const PairParameters& run) const {
    const Slot &features = args.in[0], &index = args.in[1], &positions = args.in[2];
    const std::uint32_t edges = run.nodes * k_;
    const Range run_index = index.range.sub(4ull * k_ * run.first_node, 4ull * edges);
    const Range messages = saves_
                               ? args.saved.sub(messages_.bytes(run.first_node), messages_.bytes(run.nodes))
                               : args.scratch.sub(0, messages_.bytes(run.nodes));
    const std::size_t begin = rare_offset(run.nodes), bytes = edge_bytes(run.nodes, 2);
    const Range rare = args.scratch.sub(begin, 4ull * edges),
                keys = args.scratch.sub(begin + bytes, 8ull * edges),
                order = one_run_ ? args.lists.sub(0, 8ull * edges)
                                 : args.scratch.sub(begin + 2 * bytes, 8ull * edges);
    if (!one_run_ || args.make_lists)
      messages_.record_order(args, run, run_index, positions.range, keys, order);
    messages_.record(args, run, features.range, run_index, positions.range, order, messages, rare);
    args.schedule.dispatch(attention_pipeline_,
                           {features.range, messages, weights_.of(args), args.out[0].range}, run,
                           {run.nodes, 1, 1}, 4.0 * messages_.stride() * edges);
  }

  // Nodes whose messages fit into the scratch memory, and whose edges into the grid; index rows stay aligned.
  std::uint32_t run_nodes() const {
    const std::size_t node_bytes = sizeof(float) * (messages_.stride() + 6) * k_;
    const std::size_t fit = std::min<std::size_t>(most_pair_scratch / node_bytes, capabilities_.groups / k_);
    return static_cast<std::uint32_t>(std::max<std::size_t>(64, fit / 64 * 64));
  }
  std::size_t edge_bytes(std::size_t nodes, std::size_t numbers) const {
    return scratch_aligned(sizeof(std::uint32_t) * numbers * nodes * k_);
  }
  std::size_t rare_offset(std::size_t nodes) const {
    return saves_ ? 0 : scratch_aligned(messages_.bytes(nodes));
  }

  const ops::PairAttention op_;
  const std::uint32_t k_;
  const Capabilities& capabilities_;
  PairMessages messages_;
  const bool saves_;    // messages, for the gradient
  const bool one_run_;  // does for all edges there can be
  ConstantPart weights_;
  PipelineOf<PairParameters> attention_pipeline_;
};

}  // namespace

template <>
KernelPtr make_kernel(const KernelContext& site, const ops::PairAttention& op) {
  return std::make_unique<PairAttentionKernel>(site, op);
}

}  // namespace bitr::vk
