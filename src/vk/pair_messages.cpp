#include "vk/pair_messages.hpp"

#include <algorithm>

#include "core/failure.hpp"
#include "pair_messages.spv.hpp"
#include "pair_messages_shuffle.spv.hpp"
#include "pair_messages_texels.spv.hpp"
#include "pair_networks.spv.hpp"
#include "pair_order.spv.hpp"

namespace bitr::vk {
namespace {

constexpr std::uint32_t messages_group = 32;
constexpr std::uint32_t ordered_edges = 4096;   // by a work group
constexpr std::uint32_t wide_work_group = 128;  // for pair_networks where loops would be too long for 32
constexpr std::uint32_t most_shared = 16384;    // bytes: what every device has

}  // namespace

void require_shared(std::uint32_t bytes) {
  if (bytes > most_shared)
    throw Failure(ErrorCode::unsupported, "a two-sided layer this wide takes " + std::to_string(bytes) +
                                              " bytes of shared memory, a work group has " +
                                              std::to_string(most_shared));
}

PairMessages::PairMessages(const KernelContext& site, const ops::PairAttention& op)
    : op_(without_tables(op)),
      k_(number(site.in[1].per_row)),
      capabilities_(site.context.capabilities()),
      fiber_(irreps::concatenate(op.value_fiber, op.key_fiber)) {
  for (const irreps::Fiber* fiber : {&op.fiber_in, &op.fiber_out, &op.value_fiber, &op.key_fiber})
    for (const irreps::Degree d : pair_degrees)
      if (fiber->channels(d) < 1 || fiber->degrees() != pair_degrees.size())
        throw Failure(ErrorCode::unsupported, "a two-sided layer needs the four degrees up to (1, 1)");
  tables_ = pack_pair_tables(op);
  const std::size_t bytes = sizeof(std::uint32_t) * tables_.sectors.size();
  if (bytes > capabilities_.storage_range)
    throw Failure(ErrorCode::unsupported, "radial tables of " + std::to_string(bytes) +
                                              " bytes, the device binds " +
                                              std::to_string(capabilities_.storage_range));
  check_loops();
  choose_network_edges();
  order_pipeline_ = site.context.pipeline(shaders::pair_order, std::array{messages_group, k_, ordered_edges});
  message_pipeline_ = site.context.pipeline(capabilities_.texels    ? shaders::pair_messages_texels
                                            : capabilities_.shuffle ? shaders::pair_messages_shuffle
                                                                    : shaders::pair_messages,
                                            layer_sizes(std::array{messages_group, k_, 0u}));
  network_pipeline_ =
      site.context.pipeline(shaders::pair_networks, layer_sizes({network_lanes_, k_, network_edges_}));
}

std::vector<Eigen::MatrixXd> PairMessages::weights() const {
  std::vector<Eigen::MatrixXd> all;
  for (const auto* matrices : {&op_.query, &op_.project, &op_.self})
    for (const auto& [d, matrix] : *matrices) all.push_back(matrix);
  if (op_.relu)
    for (const auto& [d, plane] : op_.planes) all.push_back(plane);
  return all;
}

std::vector<std::uint32_t> PairMessages::take_constants(VkDeviceSize offset) {
  std::vector<std::uint32_t> all;
  const auto add = [&](std::vector<std::uint32_t>& numbers) {
    const ConstantPart part{offset + sizeof(std::uint32_t) * all.size(),
                            sizeof(std::uint32_t) * numbers.size()};
    all.insert(all.end(), numbers.begin(), numbers.end());
    numbers = {};
    return part;
  };
  heads_ = add(tables_.heads);
  rays_ = add(tables_.rays);
  sectors_ = add(tables_.sectors);
  return all;
}

void PairMessages::check_loops() const {
  std::uint32_t channels = 0;
  for (const auto& [d, c] : fiber_) channels += number(c);
  const std::uint32_t rounds = capabilities_.shuffle ? capabilities_.most_subgroup : 1;
  if (in_vectors() * (tables_.tables * tables_.search + channels * (1 + 6 * rounds)) >=
      capabilities_.loop_limit)
    throw Failure(ErrorCode::unsupported, "a two-sided layer this wide takes loops too long for the device");
}

void PairMessages::choose_network_edges() {
  const std::uint32_t in = in_vectors(), messages = number(fiber_.size());
  const std::uint32_t bytes = 352 + 256 * in + 156 * tables_.tables + 4 * messages;
  require_shared(bytes + 8);
  const auto loops = [&] {
    return 8 + 64 * in + 40 * tables_.tables + rounds(messages, network_lanes_) * (60 + 384 * in);
  };
  if (loops() >= capabilities_.loop_limit) network_lanes_ = wide_work_group;
  if (loops() >= capabilities_.loop_limit)
    throw Failure(ErrorCode::unsupported, "a two-sided layer this wide takes loops too long for the device");
  // Rare edges wait for each other within a work group, but looking for them costs less in large ones.
  network_edges_ = std::min(
      {on_processor() ? 32u : 4u, (most_shared - bytes) / 8, (capabilities_.loop_limit - 1) / loops()});
}

std::vector<std::uint32_t> PairMessages::layer_sizes(const std::array<std::uint32_t, 3>& first) const {
  std::vector<std::uint32_t> sizes(first.begin(), first.end());
  for (const irreps::Fiber* fiber : {&op_.fiber_in, &op_.value_fiber, &op_.key_fiber})
    for (const irreps::Degree d : pair_degrees) sizes.push_back(number(fiber->channels(d)));
  sizes.push_back(tables_.linear);
  sizes.push_back(tables_.search);
  return sizes;
}

std::vector<std::uint32_t> PairMessages::attention_sizes(const std::array<std::uint32_t, 1>& first) const {
  auto sizes = layer_sizes(std::array{first[0], k_, number(op_.heads)});
  for (const irreps::Degree d : pair_degrees) sizes.push_back(number(op_.fiber_out.channels(d)));
  sizes.push_back(!op_.self.empty());
  sizes.push_back(op_.relu);
  sizes.push_back(op_.relu_square);
  return sizes;
}

std::uint32_t PairMessages::in_vectors() const {
  std::uint32_t most = 0;
  for (const auto& [d, m] : op_.fiber_in) most = std::max(most, padded(m) / 4);
  return most;
}

void PairMessages::record_order(const Arguments& args, const PairParameters& run, const Range& index,
                                const Range& positions, const Range& keys, const Range& order) const {
  const std::uint32_t edges = run.nodes * k_;
  args.schedule.dispatch(order_pipeline_, {index, positions, keys, order}, run,
                         {rounds(edges, ordered_edges), 1, 1}, 200.0 * edges);
}

void PairMessages::record(const Arguments& args, const PairParameters& run, const Range& features,
                          const Range& index, const Range& positions, const Range& order,
                          const Range& messages, const Range& rare) const {
  const std::uint32_t edges = run.nodes * k_;
  const Range heads = heads_.of(args), rays = rays_.of(args), sectors = sectors_.of(args);
  const double cost = 10.0 * op_.coefficient_count * edges;
  args.schedule.dispatch(message_pipeline_,
                         {features, order, positions, heads, rays, sectors, messages, rare}, run,
                         {rounds(edges, messages_group), 1, 1}, cost);
  args.schedule.dispatch(network_pipeline_,
                         {features, index, positions, heads, rays, sectors, messages, rare}, run,
                         {rounds(edges, network_edges_), 1, 1}, 10 * cost);
}

}  // namespace bitr::vk
