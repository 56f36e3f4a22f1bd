#include "model/parameter_gradients.hpp"

#include "model/fold_gradient.hpp"
#include "model/parameter_map.hpp"

namespace bitr::model {
namespace {

using graph::Graph;
using graph::Node;

class Collector {
 public:
  Collector(const Graph& made, const std::vector<std::vector<double>>& constants, const ForEach& for_each)
      : made_(made), for_each_(for_each) {
    for (std::size_t i = 0; i < made.nodes.size(); ++i)
      if (!constants[i].empty()) numbers_.emplace(made.nodes[i].name, Found{i, constants[i]});
  }

  Gradients gradients;

  auto adding() {
    return [this](const std::string& name, const auto& matrix) { gradients.at(name) += matrix; };
  }

  /// A layer, and the ReLU behind it where there is one.
  void add(const LayerSpec& spec, const ops::AttentionLayer& layer, const ReluSpec* relu_spec,
           const ops::ProjectedRelu* relu, const std::string& folded_name) {
    ops::AttentionLayer to = zeros_like(layer);
    ops::DegreeMatrices planes;
    if (const auto points = gradient<ops::PointAttention>(folded_name)) {
      add_point_attention_gradient(layer, *points, to);
      planes[{1, 0}] = points->plane;
    } else if (const auto first = gradient<ops::MeanDirection>(folded_name)) {
      add_point_attention_gradient(layer, first->general, to);
      planes[{1, 0}] = first->general.plane;
    } else if (const auto cloud = gradient<ops::CloudCoefficients>(folded_name + ".coefficients")) {
      add_point_attention_gradient(layer, cloud->full, to);
    } else if (const auto pairs = gradient<ops::PairAttention>(folded_name)) {
      const auto& op = std::get<ops::PairAttention>(made_.nodes[numbers_.at(folded_name).node].op);
      add_pair_attention_gradient(layer, op, *pairs, to, for_each_);
      planes = pairs->planes;
    } else {
      take_expanded(spec.stage, to);
      if (relu)
        if (const auto own = gradient<ops::ProjectedRelu>(relu_spec->stage)) planes = own->planes;
    }
    visit_parameters(spec, to, adding());
    if (!relu) return;
    ops::ProjectedRelu relu_to = ops::zeros_like(*relu);
    for (auto& [degree, matrix] : relu_to.planes)
      if (const auto found = planes.find(degree); found != planes.end()) matrix = found->second;
    visit_parameters(*relu_spec, relu_to, adding());
  }

  void add(const ops::Head& head, const std::string& name) {
    ops::Head to = ops::zeros_like(head);
    if (const auto own = gradient<ops::Head>(name)) to = *own;
    visit_parameters(to, adding());
  }

 private:
  struct Found {
    std::size_t node;
    const std::vector<double>& numbers;
  };

  // The operation of that name with its gradient in place of its constants.
  template <class Operation>
  std::optional<Operation> gradient(const std::string& name) const {
    const auto found = numbers_.find(name);
    if (found == numbers_.end()) return std::nullopt;
    const auto* op = std::get_if<Operation>(&made_.nodes[found->second.node].op);
    if (!op) return std::nullopt;
    Operation filled = ops::zeros_like(*op);
    const double* from = found->second.numbers.data();
    for (const auto& span : ops::constants(filled)) {
      std::copy_n(from, span.size(), span.begin());
      from += span.size();
    }
    return filled;
  }

  static ops::AttentionLayer zeros_like(const ops::AttentionLayer& layer) {
    ops::AttentionLayer zeros = layer;
    zeros.values_keys = ops::zeros_like(layer.values_keys);
    zeros.values = ops::zeros_like(layer.values);
    zeros.keys = ops::zeros_like(layer.keys);
    zeros.query = ops::zeros_like(layer.query);
    zeros.project = ops::zeros_like(layer.project);
    return zeros;
  }

  void take_expanded(const std::string& name, ops::AttentionLayer& to) const {
    if (const auto op = gradient<ops::Convolve>(name + ".vk")) to.values_keys = *op;
    if (const auto op = gradient<ops::Convolve>(name + ".v")) to.values = *op;
    if (const auto op = gradient<ops::Convolve>(name + ".k")) to.keys = *op;
    if (const auto op = gradient<ops::Linear>(name + ".q")) to.query.weights = op->weights;
    if (const auto op = gradient<ops::Linear>(name + ".project"))
      for (auto& [d, matrix] : to.project.weights) {
        // Without the columns of the centre's own features where those are zero.
        const Eigen::MatrixXd& own = op->weights.at(d);
        matrix.leftCols(own.cols()) = own;
      }
  }

  const Graph& made_;
  const ForEach& for_each_;
  std::map<std::string, Found> numbers_;
};

}  // namespace

Gradients parameter_gradients(const Weights& weights, const Graph& whole, const Graph& made,
                              const std::vector<std::vector<double>>& constants, const ForEach& for_each) {
  const Architecture net = architecture(weights.config);
  std::map<std::string, const LayerSpec*> layers;
  std::map<std::string, const ReluSpec*> relus;
  for (const auto* list : {&net.extractor, &net.pair_network})
    for (const LayerSpec& spec : *list) layers[spec.stage] = &spec;
  for (const LayerSpec* spec : {&net.pool, &net.regress, &net.extract}) layers[spec->stage] = spec;
  for (const auto* list : {&net.extractor_relu, &net.pair_relu})
    for (const ReluSpec& spec : *list) relus[spec.stage] = &spec;

  Collector collect(made, constants, for_each);
  // The official state dict holds some that nothing reads.
  for (const auto& [name, value] : weights.parameters)
    collect.gradients[name] = Eigen::MatrixXd::Zero(value.rows(), value.cols());
  for (std::size_t i = 0; i < whole.nodes.size(); ++i) {
    const Node& node = whole.nodes[i];
    if (const auto* layer = std::get_if<ops::AttentionLayer>(&node.op)) {
      // A folded layer has the name of what it makes, the ReLU behind it included.
      std::string name = whole.tensors[node.outputs.front()].name;
      const ops::ProjectedRelu* relu = nullptr;
      if (i + 1 < whole.nodes.size()) relu = std::get_if<ops::ProjectedRelu>(&whole.nodes[i + 1].op);
      if (relu && made.find(name) == graph::no_tensor)
        name = whole.tensors[whole.nodes[i + 1].outputs.front()].name;
      collect.add(*layers.at(node.name), *layer, relu ? relus.at(whole.nodes[i + 1].name) : nullptr, relu,
                  name);
    } else if (const auto* head = std::get_if<ops::Head>(&node.op)) {
      collect.add(*head, node.name);
    }
  }
  return std::move(collect.gradients);
}

}  // namespace bitr::model
