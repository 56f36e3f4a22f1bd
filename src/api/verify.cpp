#include <algorithm>
#include <cmath>

#include "api/internal.hpp"
#include "api/plan.hpp"
#include "core/guarded.hpp"

namespace bitr {
namespace {

// Float against double, and double folded against double as defined. In reference mode folding drops an eps
// that the definition keeps, which shows in double: the float bounds are taken.
constexpr double stage_bound_f32 = 5e-3, stage_bound_f64 = 1e-8;
constexpr double rotation_bound_f32 = 3.5e-4;  // 0.02°
constexpr double translation_bound_f32 = 5e-4;

StageDifference compare(std::string stage, const std::vector<double>& a, const std::vector<double>& truth,
                        double bound) {
  double worst = 0, largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double difference = std::abs(a[i] - truth[i]);
    worst = std::isnan(difference) ? difference : std::max(worst, difference);
    largest = std::max(largest, std::abs(truth[i]));
    if (std::isnan(worst)) break;
  }
  return {std::move(stage), largest > 0 ? worst / largest : worst, bound};
}

Result<std::vector<StageDifference>> verify_checked(Plan::Impl& impl, const CloudPair& pair) {
  const auto batch = pack(impl.model.config(), impl.options.precision, impl.capacity, {&pair, 1});
  if (!batch) return tl::unexpected(batch.error());
  const PlanOptions truth_options{.precision = Precision::f64, .mode = impl.mode, .as_defined = true};
  const auto tested =
      make_executor(impl.device, impl.model, {1, batch->layout.rows(graph::Rows::point)}, impl.options, true);
  const Device cpu = Internal::cpu_of(impl.device);
  const auto truth = make_executor(cpu, impl.model, {}, truth_options, true);
  if (!tested) return tl::unexpected(tested.error());
  if (!truth) return tl::unexpected(truth.error());
  for (graph::Executor* executor : {tested->get(), truth->get()}) {
    executor->prepare(batch->layout);
    fill_inputs(*batch, *executor);
    executor->run();
  }

  const bool single =
      impl.options.precision == Precision::f32 || (impl.mode == Mode::reference && !impl.options.as_defined);
  std::vector<StageDifference> differences;
  const graph::Graph &graph = (*tested)->graph(), &truth_graph = (*truth)->graph();
  const auto& tensors = graph.tensors;
  // The pose is compared by its parts below.
  const auto skipped = [&](graph::TensorId id) {
    return graph.inputs.holds(id) || id == graph.output(graph::Output::pose);
  };
  for (std::size_t i = 0; i < tensors.size(); ++i) {
    const auto id = static_cast<graph::TensorId>(i);
    const graph::TensorId other = truth_graph.find(tensors[i].name);
    if (other == graph::no_tensor || skipped(id)) continue;
    if (tensors[i].kind == graph::ElementKind::index) {
      // Neighbours: the share of the list that differs.
      const auto a = (*tested)->read<std::uint32_t>(id), b = (*truth)->read<std::uint32_t>(other);
      std::size_t wrong = 0;
      for (std::size_t e = 0; e < a.size(); ++e) wrong += a[e] != b[e];
      differences.push_back(
          {tensors[i].name, static_cast<double>(wrong) / static_cast<double>(a.size()), single ? 1e-2 : 0});
    } else {
      differences.push_back(compare(tensors[i].name, (*tested)->read<double>(id),
                                    (*truth)->read<double>(other),
                                    single ? stage_bound_f32 : stage_bound_f64));
    }
  }
  const auto pose = (*tested)->read<double>(graph::Output::pose),
             expected = (*truth)->read<double>(graph::Output::pose);
  const auto part = [](const std::vector<double>& row, int from, int to) {
    return std::vector<double>(row.begin() + from, row.begin() + to);
  };
  differences.push_back(compare("out.R", part(pose, 0, 9), part(expected, 0, 9),
                                single ? rotation_bound_f32 : stage_bound_f64));
  differences.push_back(compare("out.t", part(pose, 9, 12), part(expected, 9, 12),
                                single ? translation_bound_f32 : stage_bound_f64));
  return differences;
}

}  // namespace

Result<std::vector<StageDifference>> verify(Plan& plan, const CloudPair& pair) {
  return guarded([&] { return verify_checked(Internal::impl(plan), pair); });
}

}  // namespace bitr
