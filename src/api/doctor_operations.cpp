// Every operation of the folded network on its own: on the device, and on the CPU in double precision.
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "api/doctor.hpp"
#include "api/executor.hpp"
#include "api/internal.hpp"
#include "api/neighbor_lists.hpp"
#include "api/pack.hpp"
#include "core/failure.hpp"
#include "core/guarded.hpp"
#include "model/build.hpp"

namespace bitr {
namespace {

// A tensor's numbers, tight. Inputs are rounded to float, so that every arithmetic reads the same ones.
struct Values {
  std::vector<double> numbers;
  std::vector<std::uint32_t> indices;
};

Values read(const graph::Executor& executor, graph::TensorId id) {
  if (executor.graph().tensors[id].kind == graph::ElementKind::index)
    return {{}, executor.read<std::uint32_t>(id)};
  return {executor.read<double>(id), {}};
}

// One node of a graph as a graph.
struct Alone {
  graph::Graph graph;
  const graph::Node& node() const { return graph.nodes.front(); }
  bool index(graph::TensorId id) const { return graph.tensors[id].kind == graph::ElementKind::index; }
};

Alone alone(const graph::Graph& whole, const graph::Node& node) {
  Alone one;
  graph::Node copy{node.name, node.op, {}, {}};
  std::map<graph::TensorId, graph::TensorId> added;
  const auto add = [&](graph::TensorId id) {
    const auto [at, fresh] = added.emplace(id, graph::no_tensor);
    if (fresh) at->second = one.graph.add(whole.tensors[id]);
    return at->second;
  };
  for (const graph::TensorId id : node.inputs) copy.inputs.push_back(add(id));
  for (const graph::TensorId id : node.outputs) copy.outputs.push_back(add(id));
  one.graph.nodes.push_back(std::move(copy));
  return one;
}

std::vector<Values> run_on(const Device& device, Precision precision, const Alone& one,
                           const graph::BatchLayout& layout, const std::vector<Values>& inputs,
                           bool& guards_hold) {
  const auto executor =
      make_executor(device, one.graph, layout, {.precision = precision, .retain = true, .guard_bytes = 256});
  executor->prepare(layout);
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    const graph::TensorId id = one.node().inputs[i];
    if (one.index(id))
      executor->write(id, inputs[i].indices);
    else
      executor->write(id, inputs[i].numbers);
  }
  executor->run();
  std::vector<Values> outputs;
  for (const graph::TensorId id : one.node().outputs) outputs.push_back(read(*executor, id));
  guards_hold = guards_hold && executor->guards_hold();
  return outputs;
}

double difference(const std::vector<double>& a, const std::vector<double>& truth) {
  double worst = 0, largest = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const double d = std::abs(a[i] - truth[i]);
    if (!std::isfinite(d)) return std::numeric_limits<double>::infinity();
    worst = std::max(worst, d);
    largest = std::max(largest, std::abs(truth[i]));
  }
  return largest > 0 ? worst / largest : worst;
}

class Operations {
 public:
  Operations(const Device& device, const Device& cpu, const graph::Graph& graph, const PackedBatch& batch)
      : device_(device),
        cpu_(cpu),
        layout_(batch.layout),
        truth_(make_executor(cpu, graph, layout_, {.precision = Precision::f64, .retain = true})) {
    truth_->prepare(layout_);
    fill_inputs(batch, *truth_);
    truth_->run();
  }

  void check(std::vector<Check>& checks) {
    std::size_t broken_guards = 0;
    for (const graph::Node& node : truth_->graph().nodes) {
      Check check{"operation " + node.name, 0, ops::float_error(node.op), ""};
      try {
        measure(node, check, broken_guards);
      } catch (const Failure& failure) {
        if (failure.error().code == ErrorCode::device_lost) throw;
        check.problem = failure.what();
      }
      checks.push_back(std::move(check));
    }
    checks.push_back(
        {"operations that wrote outside their outputs", static_cast<double>(broken_guards), 0, ""});
  }

 private:
  void measure(const graph::Node& node, Check& check, std::size_t& broken_guards) {
    const Alone one = alone(truth_->graph(), node);
    std::vector<Values> inputs;
    for (const graph::TensorId id : node.inputs) inputs.push_back(input(id));
    const bool vulkan = device_.backend() == Backend::vulkan;
    bool guards_hold = true;
    const auto single = run_on(cpu_, Precision::f32, one, layout_, inputs, guards_hold);
    const auto exact = run_on(cpu_, Precision::f64, one, layout_, inputs, guards_hold);
    const auto found = vulkan ? run_on(device_, Precision::f32, one, layout_, inputs, guards_hold) : single;
    broken_guards += !guards_hold;
    for (std::size_t i = 0; i < exact.size(); ++i) {
      if (!one.index(one.node().outputs[i])) {
        check.measured = std::max(check.measured, difference(found[i].numbers, exact[i].numbers));
        continue;
      }
      // A GPU must choose as the CPU does in float; that may part from double where two are near-tied.
      const auto& expected = vulkan ? single[i].indices : exact[i].indices;
      const auto& knn = std::get<ops::Knn>(node.op);
      const NeighborSearchData search{inputs[0].numbers, inputs[1].numbers, static_cast<std::size_t>(knn.dim),
                                      static_cast<std::size_t>(knn.k)};
      check.name = "neighbours of " + node.name + ", share that differs";
      check.measured = std::max(
          check.measured, static_cast<double>(count_wrong_neighbors(search, found[i].indices, expected)) /
                              static_cast<double>(expected.size()));
      check.allowed = vulkan ? 0 : 1e-3;
    }
  }

  Values input(graph::TensorId id) const {
    Values values = read(*truth_, id);
    for (double& x : values.numbers) x = static_cast<float>(x);
    return values;
  }

  const Device &device_, &cpu_;
  const graph::BatchLayout layout_;
  const std::unique_ptr<graph::Executor> truth_;
};

}  // namespace

void check_operations(const Device& device, std::span<const OperationsRun> runs, std::vector<Check>& checks) {
  const Device cpu = Internal::cpu_of(device);
  for (const auto& [model, mode, pairs] : runs) {
    std::vector<CloudPair> clouds;
    for (const RandomPair& pair : pairs) clouds.push_back(pair.view());
    const PackedBatch batch = value_or_throw(pack(model.config(), Precision::f64, shape_of(clouds), clouds));
    const graph::Graph graph = model::fold(model::build_graph(Internal::weights(model), mode));
    std::vector<Check> found;
    Operations(device, cpu, graph, batch).check(found);
    for (Check& check : found) {
      const auto same = std::ranges::find(checks, check.name, &Check::name);
      if (same == checks.end())
        checks.push_back(std::move(check));
      else if (same->passed() && !(check.passed() && check.measured <= same->measured))
        *same = std::move(check);
    }
  }
}

}  // namespace bitr
