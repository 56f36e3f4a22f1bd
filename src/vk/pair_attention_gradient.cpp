#include <algorithm>
#include <map>
#include <numeric>

#include "core/failure.hpp"
#include "pair_attention_gradient.spv.hpp"
#include "pair_gradient_edges.spv.hpp"
#include "pair_gradient_edges_texels.spv.hpp"
#include "pair_gradient_forms.spv.hpp"
#include "pair_gradient_forms_texels.spv.hpp"
#include "pair_gradient_kernels.spv.hpp"
#include "pair_gradient_kernels_shuffle.spv.hpp"
#include "pair_gradient_kernels_texels.spv.hpp"
#include "pair_gradient_lists.spv.hpp"
#include "pair_gradient_sums.spv.hpp"
#include "pair_gradient_sums_texels.spv.hpp"
#include "pair_gradient_tables.spv.hpp"
#include "pair_gradient_tables_texels.spv.hpp"
#include "pair_gradient_turn.spv.hpp"
#include "vk/memory.hpp"
#include "vk/outer_sums.hpp"
#include "vk/pair_messages.hpp"
#include "vk/reverse_neighbours.hpp"

namespace bitr::vk {
namespace {

constexpr std::uint32_t gradient_group = 32;
constexpr std::uint32_t sum_quads = 4;  // pair_gradient_sums.comp's QUADS
constexpr std::uint32_t most_sectors = 1024, most_loops = 65000;
// Between the dispatches; a larger batch goes in several runs.
constexpr std::size_t most_gradient_scratch = std::size_t{96} << 20;

// Numbers of a node's record by degree and component, channels padded to vec4s
// (pair_attention_gradient.comp).
using DegreeVectors = std::array<RecordVectors, 4>;

// The parts of the kernel that a dispatch takes.
struct Kind {
  std::uint32_t n1, n2, tables;
  auto operator<=>(const Kind&) const = default;
};

class PairGradientKernel : public Kernel {
 public:
  PairGradientKernel(const KernelContext& site, const ops::Gradient<ops::PairAttention>& gradient)
      : gradient_(gradient),
        k_(number(site.in[1].per_row)),
        capabilities_(site.context.capabilities()),
        fiber_(irreps::concatenate(op_.value_fiber, op_.key_fiber)),
        saved_(site.saved),
        messages_(site, op_),
        sum_lanes_(std::clamp(capabilities_.subgroup_size, 8u, gradient_group)) {
    for (const ops::SectorTable& table : op_.tables)
      if (table.scale_degree == 0 && table.network->eps > 0)
        throw Failure(ErrorCode::unsupported, "models train in the scale-exact mode only");
    require_shared(4 * (2 * k_ * number(op_.heads) + number(op_.heads) + number(op_.key_fiber.size()) +
                        2 * number(op_.value_fiber.size()) + 5 * padded(op_.fiber_out.size())));
    for (const std::uint32_t x : messages_.take_constants(0)) add_constant(x);
    lay_out_record();
    lay_out_tables();
    lay_out_parts();
    weights_ = add_weights();
    blocks_ = add(block_numbers_);
    firsts_ = add(firsts_numbers_);
    tables_ = add(table_numbers_);
    jobs_ = add(products_.jobs());
    places_ = add(products_.places());
    make_pipelines(site.context);
  }

  std::size_t scratch_bytes(const graph::BatchLayout& layout) const override {
    const std::size_t rows = layout.rows(graph::Rows::pair_key);
    const std::size_t nodes = std::min<std::size_t>(rows, std::size_t{run_pairs(layout)} * layout.key_points);
    return memory({}, nodes, layout).bytes;
  }

  int listed_input() const override {
    return gradient_.grad_input_at(0) >= 0 || gradient_.grad_input_at(2) >= 0 ? 1 : -1;
  }
  std::size_t list_bytes(const graph::BatchLayout& layout) const override {
    const std::size_t rows = layout.rows(graph::Rows::pair_key);
    return lists_->bytes(rows, rows);
  }

  void record(const Arguments& args) const override {
    const std::uint32_t pairs = args.layout.pairs(), keys = args.layout.key_points,
                        most = run_pairs(args.layout);
    if (pairs == 0) return;
    if (std::size_t{std::min(most, pairs)} * keys * k_ > most_edges())
      throw Failure(ErrorCode::unsupported, "two-sided layers with " + std::to_string(keys) + " nodes of " +
                                                std::to_string(k_) +
                                                " neighbours have too many edges to train on this device");
    const Memory memory = this->memory(args.scratch, std::size_t{std::min(most, pairs)} * keys, args.layout);
    EdgeLists lists{};
    if (listed_input() >= 0)
      lists = lists_->record(args, args.in[1], graph::Rows::pair_key, graph::Rows::pair_key);
    for (std::uint32_t first = 0; first < pairs; first += most)
      record_run(args, memory, lists, first, std::min(pairs - first, most));
    const OuterSums::Memory sums{jobs_.of(args), places_.of(args), memory.partials};
    products_.record_totals(args, sums, args.tables.pair_key, pairs,
                            args.out[gradient_.constants_at()].range);
  }

 private:
  struct Memory {
    Range messages, rare, keys, order, d_messages, record, turned, d_turned, factors, ids, d_coefficients,
        d_features, d_radial, begins, sector_lists, edges, partials;
    std::size_t bytes = 0;
  };

  ConstantPart add(const std::vector<std::uint32_t>& numbers) {
    const VkDeviceSize offset = sizeof(std::uint32_t) * constants().size();
    for (const std::uint32_t x : numbers) add_constant(x);
    const VkDeviceSize bytes = sizeof(std::uint32_t) * numbers.size();
    pad_constants(64);
    return {offset, bytes};
  }

  ConstantPart add_weights() {
    const VkDeviceSize offset = sizeof(std::uint32_t) * constants().size();
    for (const Eigen::MatrixXd& matrix : messages_.weights()) add_constants(matrix);
    const VkDeviceSize bytes = sizeof(std::uint32_t) * constants().size() - offset;
    pad_constants(64);
    return {offset, bytes};
  }

  DegreeVectors vectors(const irreps::Fiber& fiber) {
    DegreeVectors all;
    for (int d = 0; d < 4; ++d) {
      const irreps::Degree degree = pair_degrees[d];
      const std::uint32_t quads = padded(fiber.channels(degree)) / 4;
      all[d] = {record_size_, number(fiber.channels(degree)), quads};
      record_size_ += number(degree.dim()) * quads;
    }
    return all;
  }

  void lay_out_record() {
    const DegreeVectors grad_output = vectors(op_.fiber_out), mixed = vectors(op_.fiber_out),
                        linear = vectors(op_.fiber_out), sum = vectors(op_.value_fiber),
                        query = vectors(op_.key_fiber), feature = vectors(op_.fiber_in);
    own_ = record_size_;
    record_size_ += padded(op_.fiber_in.size()) / 4;
    std::uint32_t count = 0;
    for (const ops::SectorTable& table : op_.tables) count += table_count(table);
    products_.begin_at(count);
    // In the order of ops::constants().
    const auto add_all = [&](const ops::DegreeMatrices& matrices, const DegreeVectors& left,
                             const DegreeVectors& right) {
      for (const auto& [degree, matrix] : matrices) {
        const auto d = std::find(pair_degrees.begin(), pair_degrees.end(), degree) - pair_degrees.begin();
        products_.add(left[d], right[d], number(degree.dim()));
      }
    };
    add_all(op_.query, query, feature);
    add_all(op_.project, grad_output, sum);
    add_all(op_.self, grad_output, feature);
    add_all(op_.planes, mixed, linear);
  }

  static std::uint32_t sector_count(const ops::SectorTable& table) {
    return number(table.size) * (table.scale_degree == 1 ? 2u : 4u) + (table.scale_degree == 1 ? 0u : 6u);
  }
  static std::uint32_t table_count(const ops::SectorTable& table) {
    return number(table.sectors()) * sector_count(table) + (table.scale_degree == 1 ? 0u : 3u);
  }

  // As pack_pair_tables() numbers them: degree out, degree in; values, then keys.
  template <class Visit>
  void for_each_part(Visit visit) const {
    for (int set = 0; set < (messages_.linear() ? 2 : 1); ++set)
      for (int to = 0; to < 4; ++to)
        for (int from = 0; from < 4; ++from)
          for (const ops::PairBlock& block : op_.blocks)
            if (block.in == pair_degrees[from] && block.out == pair_degrees[to] &&
                block.out_begin == (set == 0 ? 0 : op_.value_fiber.channels(block.out)))
              visit(block, 4 * set + to, from);
  }

  void lay_out_tables() {
    std::vector<std::uint32_t> place(op_.tables.size());
    std::uint32_t at = 0;
    for (std::size_t t = 0; t < op_.tables.size(); ++t) {
      place[t] = at;
      at += table_count(op_.tables[t]);
      sectors_ = std::max(sectors_, number(op_.tables[t].sectors()));
    }
    for_each_part([&](const ops::PairBlock& block, int, int) {
      const std::uint32_t vectors =
          number(block.freq()) * messages_.in_vectors() * number(block.out_channels);
      for (std::size_t t = 0; t < op_.tables.size(); ++t) {
        const ops::SectorTable& table = op_.tables[t];
        if (table.begin != block.coefficients) continue;
        table_numbers_.insert(table_numbers_.end(),
                              {place[t], number(table.sectors()), sector_count(table),
                               table.scale_degree == 1 ? 2u : 4u, number(table.size),
                               number(block.in_channels), number(block.out_channels), coefficient_vectors_});
        sum_units_ += rounds(vectors, sum_quads);
      }
      coefficient_vectors_ += vectors;
    });
    sector_groups_ = sectors_;
    // 2^SEARCH: the same pipelines for most layers.
    std::uint32_t most = 64;
    while (most < sectors_) most *= 2;
    sectors_ = most;
    if (sectors_ > most_sectors)
      throw Failure(ErrorCode::unsupported, "a radial table has more than 1024 sectors");
  }

  void lay_out_parts() {
    std::uint32_t coefficients = 0, table = 0;
    std::map<Kind, std::vector<std::uint32_t>> by_kind;
    firsts_numbers_.resize(32);
    for_each_part([&](const ops::PairBlock& block, int to, int from) {
      const Kind kind{block.in.p * block.out.p == 1 ? 3u : 1u, block.in.q * block.out.q == 1 ? 3u : 1u,
                      block.in.symmetric() && block.out.symmetric() ? 2u : 1u};
      const std::uint32_t differs =
          (block.in.p != block.out.p ? 1u : 0u) | (block.in.q != block.out.q ? 2u : 0u);
      const std::size_t out =
          fiber_.offset(block.out) + static_cast<std::size_t>(block.out_begin * block.out.dim());
      auto& numbers = by_kind[kind];
      numbers.insert(numbers.end(),
                     {number(4 * block.in.p + block.in.q), number(out), number(block.out_channels),
                      number(block.out.dim()) | (number(2 * block.out.q + 1) << 8), coefficients,
                      feature_vectors_, table, differs});
      firsts_numbers_[static_cast<std::size_t>(4 * to + from)] = feature_vectors_;
      coefficients += number(block.freq()) * messages_.in_vectors() * number(block.out_channels);
      feature_vectors_ += messages_.in_vectors() * kind.n1 * kind.n2;
      table += kind.tables;
    });
    for (const auto& [kind, numbers] : by_kind) {
      kinds_.push_back({kind, number(block_numbers_.size() / 8), number(numbers.size() / 8)});
      block_numbers_.insert(block_numbers_.end(), numbers.begin(), numbers.end());
    }
  }

  void make_pipelines(const Context& context) {
    node_pipeline_ = context.pipeline(shaders::pair_attention_gradient,
                                      messages_.attention_sizes(std::array{gradient_group}));
    auto sizes = messages_.layer_sizes(std::array{gradient_group, k_, 0u});
    turn_pipeline_ = context.pipeline(shaders::pair_gradient_turn, sizes);
    table_pipeline_ = context.pipeline(
        capabilities_.texels ? shaders::pair_gradient_tables_texels : shaders::pair_gradient_tables, sizes);
    edge_pipeline_ = context.pipeline(
        capabilities_.texels ? shaders::pair_gradient_edges_texels : shaders::pair_gradient_edges, sizes);
    const std::uint32_t parts = number(block_numbers_.size() / 8), tables = messages_.tables();
    for (KindParts& kind : kinds_) {
      sizes = messages_.layer_sizes(std::array{gradient_group, kind.kind.n1, kind.kind.n2});
      for (const std::uint32_t x : {kind.kind.tables, parts}) sizes.push_back(x);
      kind.pipeline = context.pipeline(capabilities_.texels    ? shaders::pair_gradient_kernels_texels
                                       : capabilities_.shuffle ? shaders::pair_gradient_kernels_shuffle
                                                               : shaders::pair_gradient_kernels,
                                       sizes);
    }
    list_pipeline_ = context.pipeline(shaders::pair_gradient_lists, std::array{gradient_group, sectors_});
    sum_pipeline_ = context.pipeline(
        capabilities_.texels ? shaders::pair_gradient_sums_texels : shaders::pair_gradient_sums,
        std::array{sum_lanes_, sectors_, tables, messages_.in_vectors()});
    form_pipeline_ = context.pipeline(
        capabilities_.texels ? shaders::pair_gradient_forms_texels : shaders::pair_gradient_forms,
        std::array{gradient_group, sectors_, tables});
    products_.make_pipelines(context, record_size_, 0, false);
    lists_.emplace(context, static_cast<int>(k_));
    const std::uint32_t row = padded(op_.fiber_in.size()), edge = row / 4 + 2;
    features_.emplace(context, EdgeGather::Shape{row, record_size_, own_, true, true, edge, 0});
    positions_.emplace(context, EdgeGather::Shape{8, record_size_, 0, false, true, edge, row / 4, k_});
  }

  std::uint32_t edge_numbers() const { return padded(op_.fiber_in.size()) + 8; }

  // Bytes of all that an edge needs.
  std::size_t edge_bytes() const {
    return sizeof(float) *
           (std::size_t{2} * messages_.stride() + 5 + 64 * messages_.in_vectors() + fiber_.size() +
            10 * messages_.tables() + 4 * coefficient_vectors_ + 4 * feature_vectors_ + edge_numbers());
  }
  // Loops go through a sector's edges, or a part of all of them.
  std::size_t most_edges() const {
    return std::min<std::size_t>(most_loops / (sectors_ > 64 ? sectors_ / 64 : 1),
                                 capabilities_.storage_range / (16 * std::size_t{coefficient_vectors_}));
  }
  // Index rows stay aligned.
  std::uint32_t run_pairs(const graph::BatchLayout& layout) const {
    const std::uint32_t edges = std::max(layout.key_points * k_, 1u), unit = 64 / std::gcd(64u, edges);
    const std::size_t most = std::min(most_edges(), most_gradient_scratch / edge_bytes());
    return std::max<std::uint32_t>(number(most / edges) / unit, 1) * unit;
  }

  Memory memory(const Range& scratch, std::size_t nodes, const graph::BatchLayout& layout) const {
    const std::size_t edges = nodes * k_;
    Memory memory;
    const auto take = [&](std::size_t numbers) {
      const std::size_t bytes = sizeof(float) * std::max<std::size_t>(numbers, 4);
      const Range range = scratch.sub(memory.bytes, bytes);
      memory.bytes += scratch_aligned(bytes);
      return range;
    };
    const std::size_t tables = messages_.tables();
    memory.messages = take(saved_ ? 0 : edges * messages_.stride());
    memory.rare = take(saved_ ? 0 : edges);
    memory.keys = take(2 * edges);
    memory.order = take(2 * edges);
    memory.d_messages = take(edges * messages_.stride());
    memory.record = take(nodes * record_size_ * 4);
    memory.turned = take(edges * 64 * messages_.in_vectors());
    memory.d_turned = take(edges * fiber_.size());
    memory.factors = take(edges * 4 * (tables + 1));
    memory.ids = take(edges * tables);
    memory.d_coefficients = take(edges * 4 * coefficient_vectors_);
    memory.d_features = take(edges * 4 * feature_vectors_);
    memory.d_radial = take(edges * 4 * tables);
    memory.begins = take(tables * (sectors_ + 1));
    memory.sector_lists = take(edges * tables);
    memory.edges = take(edges * edge_numbers());
    memory.partials = take(products_.partial_bytes(layout, graph::Rows::pair_key) / sizeof(float));
    return memory;
  }

  void record_run(const Arguments& args, Memory m, const EdgeLists& lists, std::uint32_t first_pair,
                  std::uint32_t pairs) const {
    const std::uint32_t keys = args.layout.key_points, first_node = first_pair * keys, nodes = pairs * keys,
                        edges = nodes * k_, tables = messages_.tables();
    const Range features = args.in[0].range, positions = args.in[2].range,
                index = args.in[1].range.sub(4ull * k_ * first_node, 4ull * edges),
                grad_output = args.in[gradient_.grad_output_at(0)].range,
                result = args.out[gradient_.constants_at()].range;
    const PairParameters run{first_node, nodes};
    if (saved_) m.messages = args.saved.sub(messages_.bytes(first_node), messages_.bytes(nodes));
    const auto dispatch = [&](PipelineOf<PairGradientParameters> pipeline, const std::vector<Range>& ranges,
                              std::array<std::uint32_t, 3> groups, double cost, std::uint32_t block = 0) {
      args.schedule.dispatch(pipeline, ranges,
                             PairGradientParameters{first_node, edges, block, first_pair > 0 ? 1u : 0u},
                             groups, cost);
    };
    const std::uint32_t groups = rounds(edges, gradient_group);
    const double cost = 10.0 * op_.coefficient_count * edges;

    messages_.record_order(args, run, index, positions, m.keys, m.order);
    if (!saved_) messages_.record(args, run, features, index, positions, m.order, m.messages, m.rare);
    args.schedule.dispatch(node_pipeline_,
                           {features, m.messages, weights_.of(args), grad_output, m.record, m.d_messages},
                           run, {nodes, 1, 1}, 12.0 * messages_.stride() * edges);
    std::uint32_t channels = 0;
    for (const auto& [d, c] : fiber_) channels = std::max(channels, number(c));
    dispatch(turn_pipeline_, {features, m.order, positions, m.d_messages, m.turned, m.d_turned},
             {groups, messages_.in_vectors() + channels, 1}, 20.0 * messages_.stride() * edges);
    dispatch(table_pipeline_,
             {m.order, positions, messages_.heads().of(args), messages_.rays().of(args),
              messages_.sectors().of(args), m.factors, m.ids},
             {groups, tables + 1, 1}, 100.0 * tables * edges);
    for (const KindParts& kind : kinds_)
      dispatch(kind.pipeline,
               {m.turned, m.d_turned, m.factors, m.ids, messages_.sectors().of(args),
                messages_.heads().of(args), blocks_.of(args), m.d_coefficients, m.d_features, m.d_radial},
               {groups, kind.count, 1}, cost * kind.count / 4, kind.first);
    dispatch(edge_pipeline_,
             {m.order, positions, m.messages, m.d_messages, m.turned, m.d_features, m.d_radial,
              firsts_.of(args), m.edges},
             {groups, 1, 1}, 30.0 * messages_.stride() * edges);
    dispatch(list_pipeline_, {m.ids, m.begins, m.sector_lists}, {tables, 1, 1}, 50.0 * edges * tables);
    dispatch(sum_pipeline_, {m.begins, m.sector_lists, m.factors, m.d_coefficients, tables_.of(args), result},
             {sector_groups_, sum_units_, 1}, cost);
    dispatch(form_pipeline_,
             {m.begins, m.sector_lists, m.factors, m.d_radial, messages_.heads().of(args), tables_.of(args),
              result},
             {rounds(sectors_, gradient_group) + 1, tables, 1}, 50.0 * edges * tables);

    const RowTable& table = args.tables.pair_key;
    const auto tile_of = [&](std::uint32_t pair) {
      const auto& all = table.host_tiles;
      return number(static_cast<std::size_t>(
          std::partition_point(all.begin(), all.end(), [&](const auto& tile) { return tile[0] < pair; }) -
          all.begin()));
    };
    const std::uint32_t first_tile = tile_of(first_pair), tiles = tile_of(first_pair + pairs) - first_tile;
    const OuterSums::Memory sums{jobs_.of(args), places_.of(args), m.partials};
    products_.record_sums(args, sums, m.record, table, first_tile, tiles, first_node);
    const EdgeGather::Run tile_run{first_tile, tiles, first_node, first_node * k_};
    if (const int to = gradient_.grad_input_at(0); to >= 0)
      features_->record(args, tile_run, lists, m.edges, m.record, table, args.out[to].range);
    if (const int to = gradient_.grad_input_at(2); to >= 0)
      positions_->record(args, tile_run, lists, m.edges, m.record, table, args.out[to].range);
  }

  struct KindParts {
    Kind kind;
    std::uint32_t first, count;
    PipelineOf<PairGradientParameters> pipeline = {};
  };

  const ops::Gradient<ops::PairAttention> gradient_;
  const ops::PairAttention& op_ = gradient_.op;
  const std::uint32_t k_;
  const Capabilities& capabilities_;
  const irreps::Fiber fiber_;  // messages: [values ; keys]
  const bool saved_;           // the messages, by the operation itself
  PairMessages messages_;
  OuterSums products_;
  std::uint32_t record_size_ = 0, own_ = 0;                      // vec4s
  std::uint32_t coefficient_vectors_ = 0, feature_vectors_ = 0;  // vec4s of an edge
  std::uint32_t sectors_ = 0, sector_groups_ = 0;  // a table's sectors at most; as a power of two first
  std::uint32_t sum_lanes_, sum_units_ = 0;        // lanes of a work group; a sector's work groups in all
  std::vector<std::uint32_t> block_numbers_, firsts_numbers_, table_numbers_;
  std::vector<KindParts> kinds_;
  ConstantPart weights_, blocks_, firsts_, tables_, jobs_, places_;
  PipelineOf<PairParameters> node_pipeline_;
  PipelineOf<PairGradientParameters> turn_pipeline_, table_pipeline_, edge_pipeline_, list_pipeline_,
      sum_pipeline_, form_pipeline_;
  std::optional<ReverseNeighbours> lists_;
  std::optional<EdgeGather> features_, positions_;
};

}  // namespace

template <>
KernelPtr make_kernel(const KernelContext& site, const ops::Gradient<ops::PairAttention>& op) {
  return std::make_unique<PairGradientKernel>(site, op);
}

}  // namespace bitr::vk
