#include "model/build.hpp"

#include "model/parameter_map.hpp"

namespace bitr::model {
namespace {

using graph::Graph;
using graph::Input;
using graph::Output;
using graph::Rows;
using graph::TensorId;
using irreps::Degree;
using irreps::Fiber;

constexpr double layer_norm_eps = 1e-8;
constexpr double graph_norm_eps = 1e-6;

class Builder {
 public:
  Builder(const Weights& weights, Mode mode) : weights_(weights), exact_(mode == Mode::scale_exact) {}

  Graph build() {
    const ModelConfig& config = weights_.config;
    const Architecture net = architecture(config);
    positions_ = input(Input::positions, "positions");
    const TensorId index =
        knn("graph.index", positions_, positions_, Rows::point,
            {.k = config.k_neighbor, .dilation = config.neighbor_dilation, .dim = 3, .exclude_self = true});

    TensorId feature = input_features(net.input);
    for (std::size_t i = 0; i < net.extractor.size(); ++i) {
      feature = layer(net.extractor[i], feature, index, positions_, positions_);
      if (i < net.extractor_relu.size()) feature = relu(net.extractor_relu[i], feature, Rows::point);
    }
    choose_key_points(net, feature, index);
    const TensorId near = knn("key.index", key_points_, positions_, Rows::key,
                              {.k = config.key_mean_num, .dim = 3, .exclude_self = false});
    const TensorId key_feature = layer(net.extract, feature, near, key_points_, positions_);

    const ops::MergePairs merge{config.feature_num_channels};
    const TensorId positions =
        graph_.add({.name = "bi.pos", .rows = Rows::pair_key, .width = 6, .fiber = {}});
    TensorId pair_feature = graph_.add("merge", Rows::pair_key, merge.merged());
    graph_.append("merge", merge, {key_points_, key_feature}, {positions, pair_feature});
    const TensorId pair_index = knn("bi.index", positions, positions, Rows::pair_key,
                                    {.k = config.re_convert_k, .dim = 6, .exclude_self = true});
    for (std::size_t i = 0; i < net.pair_network.size(); ++i) {
      pair_feature = layer(net.pair_network[i], pair_feature, pair_index, positions, positions);
      if (i < net.pair_relu.size()) pair_feature = relu(net.pair_relu[i], pair_feature, Rows::pair_key);
    }
    head(net.head, positions, pair_feature);
    return std::move(graph_);
  }

 private:
  const Eigen::MatrixXd& parameter(const std::string& name) const { return weights_.parameters.at(name); }

  TensorId input(Input role, const char* name) {
    return graph_.add_input(role, {.name = name, .width = 3, .fiber = {}});
  }

  TensorId knn(const char* name, TensorId queries, TensorId references, Rows rows, ops::Knn op) {
    const TensorId index = graph_.add(
        {.name = name, .rows = rows, .per_row = op.k, .kind = graph::ElementKind::index, .fiber = {}});
    graph_.append(name, op, {queries, references}, {index});
    return index;
  }

  TensorId input_features(const ops::InputFeatures& op) {
    std::vector<TensorId> inputs;
    if (op.colors) inputs.push_back(input(Input::colors, "colors"));
    if (op.normals) inputs.push_back(input(Input::normals, "normals"));
    if (op.offsets) inputs.push_back(input(Input::offsets, "offsets"));
    const TensorId feature = graph_.add("input", Rows::point, op.fiber());
    graph_.append("input", op, inputs, {feature});
    return feature;
  }

  // An operation's constants, taken by their names.
  auto take() const {
    return [this](const std::string& name, auto& matrix) { matrix = parameter(name); };
  }

  // With networks that have no numbers yet.
  ops::Convolve convolution(const Fiber& in, const Fiber& out, int sides, int scale_degree) const {
    ops::Convolve op{.sides = sides, .fiber_in = in, .fiber_out = out, .blocks = {}};
    std::map<std::string, std::shared_ptr<const ops::RadialNetwork>> networks;
    for (const RadialSpec& spec : radial_specs(in, out, sides)) {
      auto& shared = networks[spec.owner];
      if (!shared) {
        ops::RadialNetwork blank;
        blank.scale_degree = scale_degree;
        blank.eps = exact_ ? 0 : layer_norm_eps;
        shared = std::make_shared<ops::RadialNetwork>(std::move(blank));
      }
      op.blocks.push_back(spec.block);
      op.blocks.back().network = shared;
    }
    return op;
  }

  static ops::Linear linear(std::vector<Fiber> in, const Fiber& out, bool skip) {
    ops::Linear op{.fiber_in = std::move(in), .fiber_out = out, .weights = {}, .skip = {}};
    for (const auto& [d, m] : out) {
      int total = 0;
      for (const Fiber& fiber : op.fiber_in) total += fiber.channels(d);
      if (skip && total == m) op.skip.insert(d);
    }
    return op;
  }

  TensorId layer(const LayerSpec& spec, TensorId feature, TensorId index, TensorId centres,
                 TensorId neighbors) {
    ops::AttentionLayer op{.sides = spec.sides,
                           .scale_degree = spec.scale_degree,
                           .heads = spec.heads,
                           .zero_centre = spec.zero_centre,
                           .fiber_in = spec.in,
                           .fiber_out = spec.out,
                           .value_fiber = spec.value_fiber(),
                           .key_fiber = spec.key_fiber(),
                           .values_keys = {},
                           .values = {},
                           .keys = {},
                           .query = {},
                           .project = {}};
    if (spec.scale_degree == 0) {
      op.values_keys = convolution(spec.in, irreps::concatenate(op.value_fiber, op.key_fiber), spec.sides, 0);
      op.project = linear({op.value_fiber, spec.in}, spec.out, true);
    } else {
      op.values = convolution(spec.in, op.value_fiber, spec.sides, 1);
      op.keys = convolution(spec.in, op.key_fiber, spec.sides, 0);
      op.project = linear({op.value_fiber}, spec.out, false);
    }
    op.query = linear({spec.in}, op.key_fiber, true);
    visit_parameters(spec, op, take());
    const Rows rows = graph_.tensors[index].rows;
    const TensorId out = graph_.add(spec.output, rows, spec.out);
    graph_.append(spec.stage, std::move(op), {feature, index, centres, neighbors}, {out});
    return out;
  }

  TensorId relu(const ReluSpec& spec, TensorId feature, Rows rows) {
    ops::ProjectedRelu op{spec.fiber, {}, weights_.config.relu_square};
    visit_parameters(spec, op, take());
    const TensorId out = graph_.add(spec.stage, rows, spec.fiber);
    graph_.append(spec.stage, std::move(op), {feature}, {out});
    return out;
  }

  void choose_key_points(const Architecture& net, TensorId feature, TensorId index) {
    const ModelConfig& config = weights_.config;
    const TensorId pool = layer(net.pool, feature, index, positions_, positions_);
    const TensorId prob = graph_.add({.name = "key.pool_prob", .fiber = {}});
    graph_.append("key.pool_prob", ops::CloudSoftmax{1}, {pool}, {prob});
    const TensorId means = graph_.add("key.pooled_feature", Rows::cloud, net.pool.in);
    graph_.append("key.pooled_feature", ops::CloudSum{1, 0}, {prob, feature}, {means});
    const TensorId globals = graph_.add({.name = "key.pooled_global0",
                                         .rows = Rows::cloud,
                                         .width = config.key_global_merge_coe,
                                         .fiber = {}});
    graph_.append("key.pooled_global0", ops::CloudSum{1, 1}, {prob, pool}, {globals});

    const TensorId extended = graph_.add("key.regress_in", Rows::point, net.regress.in);
    graph_.append("key.regress_in", ops::ExtendFeatures{net.pool.in, config.key_global_merge_coe},
                  {feature, means, globals}, {extended});
    const TensorId logit = layer(net.regress, extended, index, positions_, positions_);
    const TensorId weight =
        graph_.add({.name = "key.pos_weight", .width = config.num_key_points, .fiber = {}});
    graph_.append("key.pos_weight", ops::CloudSoftmax{config.num_key_points}, {logit}, {weight});
    key_points_ = graph_.add_output(Output::key_points,
                                    {.name = "key.points", .rows = Rows::key, .width = 3, .fiber = {}});
    graph_.append("key.points", ops::CloudSum{config.num_key_points, 0}, {weight, positions_}, {key_points_});
  }

  void head(const Fiber& fiber, TensorId positions, TensorId feature) {
    ops::Head op;
    op.fiber = fiber;
    op.eps = exact_ ? 0 : graph_norm_eps;
    visit_parameters(op, take());
    const TensorId normed = graph_.add(
        {.name = "head.gn_out", .rows = Rows::pair_key, .width = fiber.channels({0, 0}), .fiber = {}});
    const TensorId logits =
        graph_.add({.name = "head.weight_logit", .rows = Rows::pair_key, .width = 3, .fiber = {}});
    const TensorId weights =
        graph_.add({.name = "head.weights", .rows = Rows::pair_key, .width = 3, .fiber = {}});
    const TensorId pieces =
        graph_.add({.name = "head.pieces", .rows = Rows::pair, .width = ops::piece_count, .fiber = {}});
    graph_.append("head", std::move(op), {positions, feature}, {normed, logits, weights, pieces});
    const TensorId pose = graph_.add_output(
        Output::pose, {.name = "out.pose", .rows = Rows::pair, .width = ops::pose_width, .fiber = {}});
    graph_.append("pose", ops::ProjectPose{}, {pieces}, {pose});
  }

  const Weights& weights_;
  const bool exact_;
  Graph graph_;
  TensorId positions_ = graph::no_tensor, key_points_ = graph::no_tensor;
};

}  // namespace

Graph build_graph(const Weights& weights, Mode mode) { return Builder(weights, mode).build(); }

}  // namespace bitr::model
