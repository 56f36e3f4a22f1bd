#include "model/parameter_gradients.hpp"

#include <algorithm>
#include <set>

#include "core/failure.hpp"
#include "model/fold_gradient.hpp"
#include "model/parameter_map.hpp"

namespace bitr::model {
namespace {

using graph::Graph;
using graph::Node;

// A whole graph's node, the gradient of its constants as far as it is known, and for which parts it is.
template <class Operation>
struct Sum {
  const Operation& op;
  Operation gradient;
  std::set<LayerPart> parts = {};
};

ops::AttentionLayer zeros_like(const ops::AttentionLayer& layer) {
  ops::AttentionLayer zeros = layer;
  zeros.values_keys = ops::zeros_like(layer.values_keys);
  zeros.values = ops::zeros_like(layer.values);
  zeros.keys = ops::zeros_like(layer.keys);
  zeros.query = ops::zeros_like(layer.query);
  zeros.project = ops::zeros_like(layer.project);
  return zeros;
}

// Takes the gradients of a derived graph's nodes to the nodes that those came from.
class GradientCollector {
 public:
  GradientCollector(const Graph& whole, const DerivedGraph& made, const ForEach& for_each)
      : made_(made), for_each_(for_each) {
    for (std::size_t i = 0; i < whole.nodes.size(); ++i) {
      const ops::Op& op = whole.nodes[i].op;
      if (const auto* layer = std::get_if<ops::AttentionLayer>(&op))
        layers.emplace(i, Sum<ops::AttentionLayer>{*layer, zeros_like(*layer)});
      else if (const auto* relu = std::get_if<ops::ProjectedRelu>(&op))
        relus.emplace(i, Sum<ops::ProjectedRelu>{*relu, ops::zeros_like(*relu)});
      else if (const auto* head = std::get_if<ops::Head>(&op))
        heads.emplace(i, Sum<ops::Head>{*head, ops::zeros_like(*head)});
    }
  }

  /// `numbers`: the gradient of the constants of a node of the derived graph.
  void add(std::size_t node, const std::vector<double>& numbers) {
    const Origin none, &from = node < made_.origins.size() ? made_.origins[node] : none;
    const std::string& name = made_.nodes[node].name;
    std::visit(
        [&](const auto& op) {
          if constexpr (requires { take(op, op, from, name); })
            take(op, filled(op, numbers), from, name);
          else
            throw Failure(ErrorCode::internal, name + " has a gradient that no parameter takes");
        },
        made_.nodes[node].op);
  }

  /// By node of the whole graph.
  std::map<std::size_t, Sum<ops::AttentionLayer>> layers;
  std::map<std::size_t, Sum<ops::ProjectedRelu>> relus;
  std::map<std::size_t, Sum<ops::Head>> heads;

 private:
  // The operation with its gradient in place of its constants.
  template <class Operation>
  static Operation filled(const Operation& op, const std::vector<double>& numbers) {
    Operation gradient = ops::zeros_like(op);
    const double* from = numbers.data();
    for (const auto& span : ops::constants(gradient)) {
      std::copy_n(from, span.size(), span.begin());
      from += span.size();
    }
    return gradient;
  }

  template <class Operation>
  static Sum<Operation>& sum_of(std::map<std::size_t, Sum<Operation>>& sums, const Origin& from,
                                const std::string& name) {
    for (const std::size_t node : from.nodes)
      if (const auto found = sums.find(node); found != sums.end()) return found->second;
    throw Failure(ErrorCode::internal, name + " has a gradient and came from no node with parameters");
  }

  void take(const ops::PointAttention&, const ops::PointAttention& gradient, const Origin& from,
            const std::string& name) {
    auto& layer = sum_of(layers, from, name);
    layer.parts.insert(LayerPart::all);
    add_point_attention_gradient(layer.op, gradient, layer.gradient);
    if (gradient.relu) take_planes({{{1, 0}, gradient.plane}}, from, name);
  }
  void take(const ops::MeanDirection& op, const ops::MeanDirection& gradient, const Origin& from,
            const std::string& name) {
    take(op.general, gradient.general, from, name);
  }
  void take(const ops::CloudCoefficients& op, const ops::CloudCoefficients& gradient, const Origin& from,
            const std::string& name) {
    take(op.full, gradient.full, from, name);
  }
  void take(const ops::PairAttention& op, const ops::PairAttention& gradient, const Origin& from,
            const std::string& name) {
    auto& layer = sum_of(layers, from, name);
    layer.parts.insert(LayerPart::all);
    add_pair_attention_gradient(layer.op, op, gradient, layer.gradient, for_each_);
    if (op.relu) take_planes(gradient.planes, from, name);
  }
  void take(const ops::Convolve&, const ops::Convolve& gradient, const Origin& from,
            const std::string& name) {
    auto& layer = sum_of(layers, from, name);
    layer.parts.insert(from.part);
    switch (from.part) {
      case LayerPart::values_keys:
        layer.gradient.values_keys = gradient;
        return;
      case LayerPart::values:
        layer.gradient.values = gradient;
        return;
      case LayerPart::keys:
        layer.gradient.keys = gradient;
        return;
      default:
        throw Failure(ErrorCode::internal, name + " is a convolution and no part of a layer that has one");
    }
  }
  void take(const ops::Linear&, const ops::Linear& gradient, const Origin& from, const std::string& name) {
    auto& layer = sum_of(layers, from, name);
    layer.parts.insert(from.part);
    if (from.part == LayerPart::query) {
      layer.gradient.query.weights = gradient.weights;
    } else if (from.part == LayerPart::project) {
      // Without the columns of the centre's own features where those are zero.
      for (auto& [d, matrix] : layer.gradient.project.weights) {
        const Eigen::MatrixXd& own = gradient.weights.at(d);
        matrix.leftCols(own.cols()) = own;
      }
    } else {
      throw Failure(ErrorCode::internal, name + " is a linear map and no part of a layer that is one");
    }
  }
  void take(const ops::ProjectedRelu&, const ops::ProjectedRelu& gradient, const Origin& from,
            const std::string& name) {
    take_planes(gradient.planes, from, name);
  }
  void take(const ops::Head&, const ops::Head& gradient, const Origin& from, const std::string& name) {
    auto& head = sum_of(heads, from, name);
    head.parts.insert(LayerPart::all);
    head.gradient = gradient;
  }

  void take_planes(const ops::DegreeMatrices& planes, const Origin& from, const std::string& name) {
    auto& relu = sum_of(relus, from, name);
    relu.parts.insert(LayerPart::all);
    for (auto& [degree, matrix] : relu.gradient.planes) matrix = planes.at(degree);
  }

  const DerivedGraph& made_;
  const ForEach& for_each_;
};

void expect(const std::string& node, const char* part, bool known, std::size_t constants) {
  if (!known && constants > 0)
    throw Failure(ErrorCode::internal, "the parameters of " + node + part + " have no gradient");
}

// What a node uses of its constants has to have a gradient.
void expect_complete(const std::string& node, const Sum<ops::AttentionLayer>& layer) {
  const ops::AttentionLayer& op = layer.op;
  const auto expect_part = [&](LayerPart part, const char* what, const auto& constants) {
    expect(node, what, layer.parts.count(LayerPart::all) || layer.parts.count(part),
           ops::constant_count(constants));
  };
  expect_part(LayerPart::values_keys, ", values and keys,", op.values_keys);
  expect_part(LayerPart::values, ", values,", op.values);
  expect_part(LayerPart::keys, ", keys,", op.keys);
  // The official state dict has a query for centres without features, too.
  if (!op.zero_centre) expect_part(LayerPart::query, ", query,", op.query);
  expect_part(LayerPart::project, ", projection,", op.project);
}
template <class Operation>
void expect_complete(const std::string& node, const Sum<Operation>& sum) {
  expect(node, "", !sum.parts.empty(), ops::constant_count(sum.op));
}

// By stage, which is the node's name.
template <class Spec>
class Specs {
 public:
  void add(const Spec& spec) { specs_[spec.stage] = &spec; }
  void add(const std::vector<Spec>& list) {
    for (const Spec& spec : list) add(spec);
  }
  const Spec& at(const std::string& stage) const { return *specs_.at(stage); }

 private:
  std::map<std::string, const Spec*> specs_;
};

}  // namespace

Gradients parameter_gradients(const Weights& weights, const Graph& whole, const DerivedGraph& made,
                              const std::vector<std::vector<double>>& constants, const ForEach& for_each) {
  GradientCollector collect(whole, made, for_each);
  for (std::size_t i = 0; i < constants.size(); ++i)
    if (!constants[i].empty()) collect.add(i, constants[i]);

  const Architecture net = architecture(weights.config);
  Specs<LayerSpec> layers;
  layers.add(net.extractor), layers.add(net.pair_network);
  layers.add(net.pool), layers.add(net.regress), layers.add(net.extract);
  Specs<ReluSpec> relus;
  relus.add(net.extractor_relu), relus.add(net.pair_relu);

  Gradients gradients;
  for (const auto& [name, value] : weights.parameters)
    gradients[name] = Eigen::MatrixXd::Zero(value.rows(), value.cols());
  const auto add = [&](const std::string& name, const auto& matrix) { gradients.at(name) += matrix; };
  const auto name = [&](std::size_t node) -> const std::string& { return whole.nodes[node].name; };
  for (auto& [node, layer] : collect.layers) {
    expect_complete(name(node), layer);
    visit_parameters(layers.at(name(node)), layer.gradient, add);
  }
  for (auto& [node, relu] : collect.relus) {
    expect_complete(name(node), relu);
    visit_parameters(relus.at(name(node)), relu.gradient, add);
  }
  for (auto& [node, head] : collect.heads) {
    expect_complete(name(node), head);
    visit_parameters(head.gradient, add);
  }
  return gradients;
}

}  // namespace bitr::model
