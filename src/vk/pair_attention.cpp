#include <algorithm>

#include "core/failure.hpp"
#include "pair_attention.spv.hpp"
#include "pair_messages.spv.hpp"
#include "pair_networks.spv.hpp"
#include "vk/kernel.hpp"
#include "vk/pair_tables.hpp"

namespace bitr::vk {
namespace {

constexpr Access message_bindings[] = {Access::read, Access::read, Access::read,  Access::constant,
                                       Access::read, Access::read, Access::write, Access::write};
constexpr Access network_bindings[] = {Access::read, Access::read, Access::read,  Access::constant,
                                       Access::read, Access::read, Access::write, Access::read};
constexpr Access attention_bindings[] = {Access::read, Access::read, Access::read, Access::write};
constexpr Shader message_shader{"pair_messages", spirv::pair_messages, message_bindings,
                                sizeof(PairParameters), 17};
constexpr Shader network_shader{"pair_networks", spirv::pair_networks, network_bindings,
                                sizeof(PairParameters), 17};
constexpr Shader attention_shader{"pair_attention", spirv::pair_attention, attention_bindings,
                                  sizeof(PairParameters), 24};

constexpr std::uint32_t work_group = 32;
constexpr std::uint32_t wide_work_group = 128;  // of pair_networks, where loops would be too long for 32
constexpr std::uint32_t most_shared = 16384;    // bytes: what every device has
// Messages between the dispatches; a larger batch goes in several runs.
constexpr std::size_t most_scratch = std::size_t{32} << 20;

std::uint32_t number(int x) { return static_cast<std::uint32_t>(x); }
std::uint32_t rounds(std::uint32_t items, std::uint32_t lanes) { return (items + lanes - 1) / lanes; }

class PairAttentionKernel : public Kernel {
 public:
  PairAttentionKernel(const Site& site, const ops::PairAttention& op)
      : op_(op),
        k_(number(site.in[1].per_row)),
        capabilities_(site.context.capabilities()),
        messages_(irreps::concatenate(op.value_fiber, op.key_fiber)) {
    for (const irreps::Fiber* fiber : {&op.fiber_in, &op.fiber_out, &op.value_fiber, &op.key_fiber})
      for (const irreps::Degree d : pair_degrees)
        if (fiber->channels(d) < 1 || fiber->degrees() != pair_degrees.size())
          throw Failure(ErrorCode::unsupported, "a two-sided layer needs the four degrees up to (1, 1)");
    require_shared(4 * (k_ * number(op.heads) + number(op.heads) + number(op.key_fiber.size()) +
                        number(op.value_fiber.size()) + 2 * padded(op.fiber_out.size())));
    tables_ = pack_pair_tables(op);
    heads_ = add(tables_.heads);
    rays_ = add(tables_.rays);
    sectors_ = add(tables_.sectors);
    weights_ = add_weights();
    if (sectors_.bytes > capabilities_.storage_range)
      throw Failure(ErrorCode::unsupported, "radial tables of " + std::to_string(sectors_.bytes) +
                                                " bytes, the device binds " +
                                                std::to_string(capabilities_.storage_range));
    choose_message_edges();
    choose_network_edges();
    make_pipelines(site.context);
    tables_ = {};
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
  struct Part {
    VkDeviceSize offset, bytes;  // of the constants
    Range of(const Arguments& args) const { return args.constants.sub(offset, bytes); }
  };

  Part add(const std::vector<std::uint32_t>& numbers) {
    const VkDeviceSize offset = sizeof(std::uint32_t) * constants().size();
    for (const std::uint32_t x : numbers) add_constant(x);
    return {offset, sizeof(std::uint32_t) * numbers.size()};
  }

  Part add_weights() {
    const VkDeviceSize offset = sizeof(std::uint32_t) * constants().size();
    for (const auto* matrices : {&op_.query, &op_.project, &op_.self})
      for (const auto& [d, matrix] : *matrices) add_constants(matrix);
    if (op_.relu)
      for (const auto& [d, plane] : op_.planes) add_constants(plane);
    return {offset, sizeof(std::uint32_t) * constants().size() - offset};
  }

  // Shared memory and loops are as the shaders' headers state them.
  static void require_shared(std::uint32_t bytes) {
    if (bytes > most_shared)
      throw Failure(ErrorCode::unsupported, "a two-sided layer this wide takes " + std::to_string(bytes) +
                                                " bytes of shared memory, a work group has " +
                                                std::to_string(most_shared));
  }
  bool on_processor() const { return capabilities_.type == VK_PHYSICAL_DEVICE_TYPE_CPU; }

  void choose_message_edges() {
    const std::uint32_t in = in_vectors(), bytes = 100 + 256 * in + 16 * tables_.tables;
    require_shared(bytes);
    // Fewer spread over more of a graphics processor.
    message_edges_ = std::min(on_processor() ? 16u : 8u, most_shared / bytes);
    const auto loops = [&] {
      std::uint32_t all = tables_.tables + rounds(4 * in * message_edges_, work_group) +
                          rounds(tables_.tables * message_edges_, work_group) * (1 + tables_.search);
      for (const irreps::Degree d : pair_degrees)
        all += rounds(number(messages_.channels(d)) * message_edges_, work_group) *
               (2 + 12 * in * number(1 + d.p));
      return all;
    };
    while (message_edges_ > 1 && loops() >= capabilities_.loop_limit) --message_edges_;
    if (loops() >= capabilities_.loop_limit)
      throw Failure(ErrorCode::unsupported,
                    "a two-sided layer this wide takes loops too long for the device");
  }

  void choose_network_edges() {
    const std::uint32_t in = in_vectors(), messages = number(messages_.size());
    const std::uint32_t bytes = 352 + 256 * in + 156 * tables_.tables + 4 * messages;
    require_shared(bytes + 8);
    const auto loops = [&] {
      return 8 + 64 * in + 40 * tables_.tables + rounds(messages, network_lanes_) * (60 + 384 * in);
    };
    if (loops() >= capabilities_.loop_limit) network_lanes_ = wide_work_group;
    if (loops() >= capabilities_.loop_limit)
      throw Failure(ErrorCode::unsupported,
                    "a two-sided layer this wide takes loops too long for the device");
    // Rare edges wait for each other within a work group, but looking for them costs less in large ones.
    network_edges_ = std::min(
        {on_processor() ? 32u : 4u, (most_shared - bytes) / 8, (capabilities_.loop_limit - 1) / loops()});
  }

  void make_pipelines(const Context& context) {
    message_pipeline_ = &context.pipeline(message_shader, layer_sizes(message_edges_));
    auto sizes = layer_sizes(network_edges_);
    sizes[0] = network_lanes_;
    network_pipeline_ = &context.pipeline(network_shader, sizes);
    sizes = layer_sizes(number(op_.heads));
    for (const irreps::Degree d : pair_degrees) sizes.push_back(number(op_.fiber_out.channels(d)));
    sizes.push_back(!op_.self.empty());
    sizes.push_back(op_.relu);
    sizes.push_back(op_.relu_square);
    attention_pipeline_ = &context.pipeline(attention_shader, sizes);
  }

  // Specialization constants 0 … 16.
  std::vector<std::uint32_t> layer_sizes(std::uint32_t third) const {
    const auto in = [&](int d) { return number(op_.fiber_in.channels(pair_degrees[d])); };
    const auto values = [&](int d) { return number(op_.value_fiber.channels(pair_degrees[d])); };
    const auto keys = [&](int d) { return number(op_.key_fiber.channels(pair_degrees[d])); };
    return {work_group, k_,        third,     in(0),          in(1),         in(2),
            in(3),      values(0), values(1), values(2),      values(3),     keys(0),
            keys(1),    keys(2),   keys(3),   tables_.linear, tables_.search};
  }

  void record_run(const Arguments& args, const PairParameters& run) const {
    const Slot &features = args.in[0], &index = args.in[1], &positions = args.in[2];
    const std::uint32_t edges = run.nodes * k_;
    const Range run_index = index.range.sub(4ull * k_ * run.first_node, 4ull * edges);
    const Range messages = args.scratch.sub(0, 4ull * message_stride() * edges);
    const Range rare = args.scratch.sub(rare_offset(run.nodes), 4ull * edges);
    const Range heads = heads_.of(args), rays = rays_.of(args), sectors = sectors_.of(args);
    const double cost = 10.0 * op_.coefficient_count * edges;
    args.schedule.dispatch(*message_pipeline_,
                           {features.range, run_index, positions.range, heads, rays, sectors, messages, rare},
                           run, {rounds(edges, message_edges_), 1, 1}, cost);
    args.schedule.dispatch(*network_pipeline_,
                           {features.range, run_index, positions.range, heads, rays, sectors, messages, rare},
                           run, {rounds(edges, network_edges_), 1, 1}, 10 * cost);
    args.schedule.dispatch(*attention_pipeline_,
                           {features.range, messages, weights_.of(args), args.out[0].range}, run,
                           {run.nodes, 1, 1}, 4.0 * message_stride() * edges);
  }

  std::uint32_t in_vectors() const {
    std::uint32_t most = 0;
    for (const auto& [d, m] : op_.fiber_in) most = std::max(most, padded(m) / 4);
    return most;
  }
  std::uint32_t message_stride() const { return padded(messages_.size()); }

  // Nodes whose messages fit into the scratch memory, and whose edges into the grid; index rows stay aligned.
  std::uint32_t run_nodes() const {
    const std::size_t node_bytes = sizeof(float) * (message_stride() + 1) * k_;
    const std::size_t fit = std::min<std::size_t>(most_scratch / node_bytes, capabilities_.groups / k_);
    return static_cast<std::uint32_t>(std::max<std::size_t>(64, fit / 64 * 64));
  }
  std::size_t rare_offset(std::size_t nodes) const {
    return (sizeof(float) * message_stride() * nodes * k_ + 255) / 256 * 256;
  }

  const ops::PairAttention op_;
  const std::uint32_t k_;
  const Capabilities& capabilities_;
  const irreps::Fiber messages_;
  Part heads_{}, rays_{}, sectors_{}, weights_{};
  PairTables tables_;
  std::uint32_t message_edges_ = 1, network_edges_ = 1, network_lanes_ = work_group;
  const Pipeline *message_pipeline_ = nullptr, *network_pipeline_ = nullptr, *attention_pipeline_ = nullptr;
};

}  // namespace

KernelPtr make_kernel(const Site& site, const ops::PairAttention& op) {
  return std::make_unique<PairAttentionKernel>(site, op);
}

}  // namespace bitr::vk
