#include "vk/point_attention_gradient.hpp"

#include <algorithm>

#include "core/failure.hpp"
#include "point_attention_gradient.spv.hpp"
#include "point_attention_gradient_texels.spv.hpp"
#include "point_attention_sums.spv.hpp"
#include "point_attention_sums_texels.spv.hpp"
#include "vk/memory.hpp"
#include "vk/outer_sums.hpp"
#include "vk/point_flags.hpp"
#include "vk/reverse_neighbours.hpp"

namespace bitr::vk {
namespace {

constexpr std::uint32_t listed_tiles = 32;
constexpr std::size_t cached_rows = 4096 + 63;

std::uint32_t quads(int n) { return padded(n) / 4; }

// What is kept of a row, in vec4s (common/point_record.glsl).
struct Record {
  explicit Record(const ops::PointAttention& op) {
    const int heads = op.heads, n0 = op.n0(), n1 = op.m1 > 0 ? op.n1() : 0, z0 = op.c0 + 1,
              z1 = op.m1 > 0 ? op.c1 : 0;
    const int queries = op.uniform ? 0 : 1, vector_queries = op.M1.size() > 0 ? 1 : 0;
    given0 = scalars(op.m0);
    given1 = vectors(op.m1);
    mixed = vectors(op.relu ? op.m1 : 0);
    linear = vectors(op.relu ? op.m1 : 0);
    own0 = scalars(z0);
    own1 = vectors(op.c1);
    sum0 = scalars(heads * n0);
    sum1 = vectors(heads * n1);
    query0 = scalars(queries * heads * n0);
    query1 = vectors(vector_queries * heads * n1);
    zero_sum0 = scalars(heads * z0);
    zero_sum1 = vectors(heads * z1);
    zero_query0 = scalars(queries * heads * z0);
    zero_query1 = vectors(vector_queries * heads * z1);
    if (op.m1 == 0) scalars(heads * n0), scalars(heads * z0);
    state = scalars(4 * (1 + heads)).at;
    own = scalars(op.c0 + 3 * op.c1).at;
    centre = scalars(4).at;
  }
  RecordVectors given0, given1, mixed, linear, own0, own1, sum0, sum1, query0, query1, zero_sum0, zero_sum1,
      zero_query0, zero_query1;
  std::uint32_t state, own, centre, size = 0;

 private:
  RecordVectors scalars(int n) {
    const RecordVectors result{size, number(n), 0};
    size += quads(n);
    return result;
  }
  RecordVectors vectors(int n) {
    const RecordVectors result{size, number(n), quads(n)};
    size += 3 * quads(n);
    return result;
  }
};

// One for all tiles, and one for those that have edges of length zero.
using Pipelines = std::array<PipelineOf<PointGradientParameters>, 2>;

class PointGradientKernel : public Kernel {
 public:
  PointGradientKernel(const KernelContext& site, const ops::PointAttention& op,
                      const PointGradientSlots& slots)
      : op_(op),
        slots_(slots),
        capabilities_(site.context.capabilities()),
        layout_(op),
        k_(number(site.in[slots.index].per_row)),
        saved_(site.saved),
        rows_(site.in[slots.grad_output].rows),
        points_(site.in[slots.neighbors].rows) {
    if (op.per_cloud && (op.relu || slots.d_centres >= 0 || slots.d_constants >= 0))
      throw Failure(ErrorCode::unsupported,
                    "a layer with coefficients per cloud has no gradient of those alone");
    weights_ = add_weights();
    if (slots.d_constants >= 0) add_products();
    if (slots.d_coefficients >= 0) add_coefficient_products();
    jobs_ = add(products_.jobs());
    places_ = add(products_.places());
    make_pipelines(site.context);
    if (slots.d_features >= 0) lists_.emplace(site.context, static_cast<int>(k_));
  }

  std::size_t scratch_bytes(const graph::BatchLayout& layout) const override { return memory(layout).bytes; }
  int listed_input() const override { return lists_ ? slots_.index : -1; }
  std::size_t list_bytes(const graph::BatchLayout& layout) const override {
    return lists_->bytes(layout.rows(rows_), layout.rows(points_));
  }

  void record(const Arguments& args) const override {
    const Memory memory = this->memory(args.layout);
    const RowTable &table = args.tables.of(rows_), &points = args.tables.of(points_);
    const Range records = args.scratch.sub(0, memory.edges),
                edges = args.scratch.sub(memory.edges, memory.edge_bytes);
    const OuterSums::Memory sums{jobs_.of(args), places_.of(args),
                                 args.scratch.sub(memory.partials, memory.partial_bytes)};
    EdgeLists lists{records, records, records};
    if (lists_) lists = lists_->record(args, args.in[slots_.index], rows_, points_);
    for (const Run& run : runs(args.layout, table)) {
      record_rows(args, table, run, records, edges);
      if (!products_.empty())
        products_.record_sums(args, sums, records, table, run.rows.first, run.rows.count, run.rows.first_row);
      if (slots_.d_centres >= 0)
        centres_->record(args, {run.rows.first, run.rows.count, run.rows.first_row, 0}, lists, records,
                         records, table, args.out[slots_.d_centres].range);
      if (slots_.d_features >= 0) {
        const auto [first, end] = tiles_of(points, run.first_cloud, run.end_cloud);
        features_->record(args, {first, end - first, run.rows.first_row, run.rows.first_row * k_}, lists,
                          edges, records, points, args.out[slots_.d_features].range);
      }
    }
    const int totals = slots_.d_constants >= 0 ? slots_.d_constants : slots_.d_coefficients;
    if (totals >= 0) products_.record_totals(args, sums, table, args.layout.clouds(), args.out[totals].range);
  }

 private:
  struct Part {
    VkDeviceSize offset, bytes;  // where it is in the constants
    Range of(const Arguments& args) const { return args.constants.sub(offset, bytes); }
  };
  // Whole clouds whose records and edges fit into one binding.
  struct Run {
    std::uint32_t first_cloud, end_cloud;
    TileRun rows;
  };
  struct Memory {
    std::size_t edges, edge_bytes, partials, partial_bytes, bytes;  // records come first
  };

  Part add(const std::vector<std::uint32_t>& numbers) {
    const VkDeviceSize offset = sizeof(std::uint32_t) * constants().size();
    for (const std::uint32_t x : numbers) add_constant(x);
    if (numbers.empty()) add_constant(0u);
    pad_constants(64);
    return {offset, sizeof(std::uint32_t) * std::max<std::size_t>(numbers.size(), 4)};
  }

  Part add_weights() {
    const ops::PointAttention& op = op_;
    for (const auto* matrix : {&op.M1, &op.O1, &op.S1, &op.Mz1, &op.Oz1, &op.plane}) add_constants(*matrix);
    pad_constants(4);
    if (!op.per_cloud)
      for (const auto* matrix : {&op.M0, &op.O0, &op.S0, &op.Mz0, &op.Oz0}) add_constants(*matrix);
    pad_constants(4);
    if (slots_.constant) add_constant(*slots_.constant);
    if (constants().empty()) add_constant(0.0);
    pad_constants(4);
    const VkDeviceSize bytes = sizeof(std::uint32_t) * constants().size();
    pad_constants(64);
    return {0, bytes};
  }

  // In the order of ops::constants().
  void add_products() {
    const Record& r = layout_;
    const auto add = [this](const Eigen::MatrixXd& matrix, const RecordVectors& left,
                            const RecordVectors& right, std::uint32_t components, bool flagged = false) {
      if (matrix.size() > 0) products_.add(left, right, components, false, flagged);
    };
    add(op_.M0, r.query0, r.own0, 1);
    add(op_.M1, r.query1, r.own1, 3);
    add(op_.O0, r.given0, r.sum0, 1);
    add(op_.O1, r.given1, r.sum1, 3);
    add(op_.S0, r.given0, r.own0, 1);
    add(op_.S1, r.given1, r.own1, 3);
    add(op_.Mz0, r.zero_query0, r.own0, 1, true);
    add(op_.Mz1, r.zero_query1, r.own1, 3, true);
    add(op_.Oz0, r.given0, r.zero_sum0, 1, true);
    add(op_.Oz1, r.given1, r.zero_sum1, 3, true);
    add(op_.plane, r.mixed, r.linear, 3);
  }

  // As ops::PointAttention states them.
  void add_coefficient_products() {
    const Record& r = layout_;
    products_.add(r.query0, r.own0, 1, true);
    products_.add(r.given0, r.sum0, 1, true);
    products_.add(r.given0, r.own0, 1, true);
    products_.add(r.zero_query0, r.own0, 1, true, true);
    products_.add(r.given0, r.zero_sum0, 1, true, true);
  }

  void make_pipelines(const Context& context) {
    const ops::PointAttention& op = op_;
    const std::uint32_t flags = point_flags(op) | (slots_.constant ? POINT_CONSTANT : 0) |
                                (slots_.d_features >= 0 ? POINT_FEATURES : 0) |
                                (slots_.d_centres >= 0 ? POINT_CENTRES : 0);
    for (const bool zero : {false, true}) {
      const auto sizes = std::array{tile_rows,
                                    k_,
                                    number(op.c0),
                                    number(op.c1),
                                    number(op.m0),
                                    number(op.m1),
                                    number(op.heads),
                                    flags | (zero     ? POINT_ZERO
                                             : saved_ ? POINT_KEPT
                                                      : 0),
                                    static_cast<std::uint32_t>(weights_.bytes / 16)};
      sum_pipelines_[zero] = context.pipeline(
          capabilities_.texels ? shaders::point_attention_sums_texels : shaders::point_attention_sums, sizes);
      gradient_pipelines_[zero] = context.pipeline(
          capabilities_.texels ? shaders::point_attention_gradient_texels : shaders::point_attention_gradient,
          sizes);
    }
    if (!products_.empty())
      products_.make_pipelines(context, layout_.size, layout_.state, slots_.d_coefficients >= 0);
    if (slots_.d_features >= 0)
      features_.emplace(context, EdgeGather::Shape{feature_width(), layout_.size, layout_.own, !op.uniform,
                                                   true, feature_width() / 4});
    if (slots_.d_centres >= 0)
      centres_.emplace(context, EdgeGather::Shape{4, layout_.size, layout_.centre, true, false});
  }

  std::uint32_t feature_width() const { return padded(op_.c0 + 3 * op_.c1); }
  std::size_t record_bytes() const { return 16 * std::size_t{layout_.size}; }
  std::size_t edge_bytes() const {
    return slots_.d_features >= 0 ? sizeof(float) * std::size_t{feature_width()} * k_ : 0;
  }
  std::size_t most_rows() const {
    return capabilities_.storage_range / std::max(record_bytes(), edge_bytes());
  }
  // What edges send is read in no order: on a processor, while it is in a cache.
  std::size_t usual_rows() const {
    const bool processor = capabilities_.type == VK_PHYSICAL_DEVICE_TYPE_CPU;
    return processor ? std::min(cached_rows, most_rows()) : most_rows();
  }

  Memory memory(const graph::BatchLayout& layout) const {
    const std::size_t rows = std::min(layout.rows(rows_), most_rows());
    Memory memory{};
    memory.edges = scratch_aligned(rows * record_bytes());
    memory.edge_bytes = std::max<std::size_t>(scratch_aligned(rows * edge_bytes()), 256);
    memory.partials = memory.edges + memory.edge_bytes;
    memory.partial_bytes =
        std::max<std::size_t>(scratch_aligned(products_.partial_bytes(layout, rows_)), 256);
    memory.bytes = memory.partials + memory.partial_bytes;
    return memory;
  }

  std::vector<Run> runs(const graph::BatchLayout& layout, const RowTable& table) const {
    std::vector<Run> all;
    const std::uint32_t clouds = layout.clouds();
    for (std::uint32_t first = 0; first < clouds;) {
      const std::size_t first_row = layout.begin(rows_, first) / 64 * 64;
      std::uint32_t end = first;
      while (end < clouds &&
             layout.begin(rows_, end + 1) - first_row <= (end > first ? usual_rows() : most_rows()))
        ++end;
      if (end == first)
        throw Failure(ErrorCode::unsupported,
                      "a cloud of " +
                          std::to_string(layout.begin(rows_, first + 1) - layout.begin(rows_, first)) +
                          " points; this device trains on at most " + std::to_string(most_rows() - 63));
      const auto [first_tile, end_tile] = tiles_of(table, first, end);
      all.push_back({first,
                     end,
                     {first_tile, end_tile - first_tile, static_cast<std::uint32_t>(first_row),
                      static_cast<std::uint32_t>(layout.begin(rows_, end))}});
      first = end;
    }
    return all;
  }

  static std::array<std::uint32_t, 2> tiles_of(const RowTable& table, std::uint32_t first,
                                               std::uint32_t end) {
    const auto before = [&](std::uint32_t segment) {
      const auto& all = table.host_tiles;
      return static_cast<std::uint32_t>(
          std::partition_point(all.begin(), all.end(), [&](const auto& tile) { return tile[0] < segment; }) -
          all.begin());
    };
    return {before(first), before(end)};
  }

  void record_rows(const Arguments& args, const RowTable& table, const Run& run, const Range& records,
                   const Range& edges) const {
    const TileRun& rows = run.rows;
    if (rows.count == 0) return;
    const Range centres = args.in[slots_.centres].range;
    const Range features = slots_.features >= 0 ? args.in[slots_.features].range : centres;
    const std::vector<Range> shared = {features,
                                       rows_of(args.in[slots_.index], rows),
                                       centres,
                                       args.in[slots_.neighbors].range,
                                       op_.per_cloud ? args.in[slots_.coefficients].range : features,
                                       table.tiles};
    const auto with = [&](std::initializer_list<Range> more) {
      std::vector<Range> all = shared;
      all.insert(all.end(), more);
      return all;
    };
    const double cost = k_ * (10.0 + op_.heads) * (op_.n0() + 3 * op_.n1());
    const auto most =
        static_cast<std::uint32_t>(std::clamp(most_cost / (5 * cost * tile_rows), 1.0, 65535.0));
    const auto dispatch = [&](const Pipelines& pipelines, std::array<const std::vector<Range>*, 2> ranges,
                              double factor) {
      for (std::uint32_t first = 0; first < rows.count; first += most) {
        const std::uint32_t tiles = std::min(rows.count - first, most);
        const PointGradientParameters parameters{rows.first + first, tiles, rows.first_row};
        args.schedule.dispatch(pipelines[0], *ranges[0], parameters, {tiles, 1, 1},
                               factor * cost * tiles * tile_rows);
        // Tiles that have edges of length zero, once more.
        args.schedule.dispatch(pipelines[1], *ranges[1], parameters,
                               {(tiles + listed_tiles - 1) / listed_tiles, 1, 1}, factor * cost * tiles);
      }
    };
    const Range weights = weights_.of(args);
    std::vector<Range> sums = with({args.in[slots_.grad_output].range, records, weights}), all_sums = sums;
    if (saved_) sums[3] = args.saved;
    dispatch(sum_pipelines_, {&sums, &all_sums}, 1);
    const std::vector<Range> gradients = with({records, edges, weights});
    dispatch(gradient_pipelines_, {&gradients, &gradients}, 4);
  }

  const ops::PointAttention op_;
  const PointGradientSlots slots_;
  const Capabilities& capabilities_;
  const Record layout_;
  const std::uint32_t k_;
  const bool saved_;  // what the layer sums over edges, by itself
  const graph::Rows rows_, points_;
  OuterSums products_;
  Part weights_{}, jobs_{}, places_{};
  Pipelines sum_pipelines_, gradient_pipelines_;
  std::optional<ReverseNeighbours> lists_;
  std::optional<EdgeGather> features_, centres_;
};

}  // namespace

std::size_t saved_row_bytes(const ops::PointAttention& op) {
  return 16 * (std::size_t{quads(op.heads * op.n0())} + 3 * quads(op.m1 > 0 ? op.heads * op.n1() : 0) + 1 +
               static_cast<std::size_t>(op.heads));
}

KernelPtr make_point_gradient(const KernelContext& site, const ops::PointAttention& op,
                              const PointGradientSlots& slots) {
  return std::make_unique<PointGradientKernel>(site, op, slots);
}

template <>
KernelPtr make_kernel(const KernelContext& site, const ops::Gradient<ops::PointAttention>& op) {
  if (op.grad_input_at(3) >= 0)
    throw Failure(ErrorCode::unsupported, "gradients with respect to points run on the CPU only");
  return make_point_gradient(site, op.op,
                             {.features = 0,
                              .index = 1,
                              .centres = 2,
                              .neighbors = 3,
                              .coefficients = op.op.per_cloud ? 4 : -1,
                              .grad_output = op.grad_output_at(0),
                              .d_features = op.grad_input_at(0),
                              .d_centres = op.grad_input_at(2),
                              .d_coefficients = op.op.per_cloud ? op.grad_input_at(4) : -1,
                              .d_constants = op.constants_at()});
}

}  // namespace bitr::vk
