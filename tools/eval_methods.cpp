#include "eval_methods.hpp"

#include <algorithm>
#include <bitr/refine.hpp>
#include <bitr/solve.hpp>
#include <cmath>

#include "api/internal.hpp"
#include "core/finite.hpp"
#include "core/thread_pool.hpp"
#include "options.hpp"
#include "refine/icp.hpp"
#include "refine/principal_axes.hpp"
#include "stopwatch.hpp"

namespace bitr::tool {
namespace {

Result<Method> control_named(const std::string& name) {
  if (name == "identity") return Method{.name = name};
  if (name == "solve") return Method{.name = name, .kind = MethodKind::solve};
  if (name == "pca-icp") return Method{.name = name, .kind = MethodKind::principal_axes};
  if (name != "complete-match")
    return fail(ErrorCode::invalid_argument, "--methods: \"" + name + "\" is not one of " +
                                                 std::string(control_names) +
                                                 ", with or without +icp, +ot or +trimmed-icp");
  auto model = untrained_model();
  if (!model) return tl::unexpected(model.error());
  return Method{.name = name, .kind = MethodKind::network, .model = std::move(*model)};
}

Result<void> add_models(const MethodChoice& choice, std::vector<Method>& methods) {
  for (const std::string& file : choice.models) {
    auto model = find_model(file);
    if (!model) return tl::unexpected(model.error());
    if (model->config().get_color)
      return fail(ErrorCode::invalid_argument, file + ": reads colours, which the samples do not have");
    const std::string name = model->name();
    const auto like = std::find_if(methods.begin(), methods.end(),
                                   [&](const Method& other) { return other.model->name() == name; });
    if (like != methods.end()) like->name = like->file;
    const std::string shown = like == methods.end() ? name : file;
    for (const Method& other : methods)
      if (other.file == file) return fail(ErrorCode::invalid_argument, file + ": is given twice");
    methods.push_back({.name = shown,
                       .kind = MethodKind::network,
                       .plain = true,
                       .refined = choice.refined,
                       .file = file,
                       .model = std::move(*model)});
  }
  return {};
}

Result<void> add_controls(const std::vector<std::string>& names, std::vector<Method>& methods) {
  for (std::string name : names) {
    const FollowName* follow = std::find_if(std::begin(follows), std::end(follows), [&](const FollowName& f) {
      return name.ends_with("+" + std::string(f.name));
    });
    if (follow != std::end(follows)) name.resize(name.size() - follow->name.size() - 1);
    auto method = control_named(name);
    if (!method) return tl::unexpected(method.error());
    auto known = std::find_if(methods.begin(), methods.end(),
                              [&](const Method& other) { return other.name == name && other.file.empty(); });
    if (known == methods.end()) known = methods.insert(methods.end(), std::move(*method));
    if (follow == std::end(follows))
      known->plain = true;
    else if (std::find(known->refined.begin(), known->refined.end(), follow->follow) == known->refined.end())
      known->refined.push_back(follow->follow);
  }
  return {};
}

Result<Estimate> run_network(Method& method, std::span<const DataSample> batch, const Estimation& how) {
  const std::vector<CloudPair> pairs = pairs_of(batch);
  Estimate estimate;
  const Stopwatch planning;
  const BatchShape needed = shape_of(pairs);
  const BatchShape held = method.plan ? method.plan->capacity() : BatchShape{0, 0};
  if (needed.pairs > held.pairs || needed.points > held.points) {
    auto plan = make_plan(how.device, *method.model,
                          {std::max(needed.pairs, held.pairs), std::max(needed.points, held.points)},
                          {.mode = how.mode});
    if (!plan) return tl::unexpected(plan.error());
    method.plan.emplace(std::move(*plan));
  }
  estimate.beside_milliseconds = planning.milliseconds();
  const auto assemblies =
      assemble(*method.plan, pairs, {.complete_match = method.file.empty(), .diagnostics = false});
  if (!assemblies) return tl::unexpected(assemblies.error());
  for (const Assembly& assembly : *assemblies) estimate.poses.push_back(assembly.T_reference_source);
  if (how.answers > 0 && !method.file.empty()) {
    auto evidence = resample(*method.plan, pairs, *assemblies, {.answers = how.answers});
    if (!evidence) return tl::unexpected(evidence.error());
    estimate.evidence = std::move(*evidence);
    for (std::size_t i = 0; i < pairs.size(); ++i)
      if (estimate.evidence[i]) estimate.poses[i] = estimate.evidence[i]->T_reference_source;
  }
  return estimate;
}

Result<Estimate> run_solve(std::span<const DataSample> batch, const Estimation& how) {
  const auto solutions = solve(how.device, pairs_of(batch), {.answers = how.answers});
  if (!solutions) return tl::unexpected(solutions.error());
  Estimate estimate;
  for (const Solution& solution : *solutions) {
    estimate.poses.push_back(solution.best.T_reference_source);
    estimate.confidences.push_back({solution.best.confidence, solution.reasons, {}});
  }
  return estimate;
}

/// Calls of(i) for every sample of the batch, on all threads.
template <class Of>
std::vector<Pose> for_each_sample(std::span<const DataSample> batch, const Device& device, Of of) {
  std::vector<Pose> poses(batch.size());
  Internal::pool(device).parallel_for(batch.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) poses[i] = of(i);
  });
  return poses;
}

}  // namespace

Result<std::vector<Method>> choose_methods(const MethodChoice& choice) {
  std::vector<Method> methods;
  if (auto added = add_models(choice, methods); !added) return tl::unexpected(added.error());
  std::vector<std::string> controls = choice.controls;
  if (controls.empty() && methods.empty()) controls = {"solve", "identity", "pca-icp", "complete-match"};
  if (auto added = add_controls(controls, methods); !added) return tl::unexpected(added.error());
  return methods;
}

std::vector<CloudPair> pairs_of(std::span<const DataSample> batch) {
  std::vector<CloudPair> pairs;
  for (const DataSample& sample : batch) pairs.push_back({sample.source, sample.reference});
  return pairs;
}

Result<Estimate> estimate(Method& method, std::span<const DataSample> batch, const Estimation& how) {
  switch (method.kind) {
    case MethodKind::identity:
      return Estimate{std::vector<Pose>(batch.size())};
    case MethodKind::network:
      return run_network(method, batch, how);
    case MethodKind::solve:
      return run_solve(batch, how);
    case MethodKind::principal_axes:
      break;
  }
  return Estimate{for_each_sample(batch, how.device, [&](std::size_t i) {
    return refine::icp_from_principal_axes(batch[i].source.positions, batch[i].reference.positions,
                                           {.keep = how.keep})
        .T_reference_source;
  })};
}

std::string_view name(Follow follow) {
  return std::find_if(std::begin(follows), std::end(follows),
                      [&](const FollowName& known) { return known.follow == follow; })
      ->name;
}

Result<std::vector<Pose>> refined(const std::vector<Pose>& poses, Follow follow,
                                  std::span<const DataSample> batch, const Estimation& how) {
  if (follow == Follow::trimmed_icp)
    return for_each_sample(batch, how.device, [&](std::size_t i) {
      if (!is_finite(poses[i])) return poses[i];
      return refine::Icp(batch[i].reference.positions, {.keep = how.keep})
          .align(batch[i].source.positions, poses[i])
          .T_reference_source;
    });
  const std::vector<CloudPair> pairs = pairs_of(batch);
  std::vector<Pose> starts = poses;
  for (Pose& start : starts)
    if (!is_finite(start)) start = {};
  const RefineMethod method = follow == Follow::icp ? RefineMethod::icp : RefineMethod::transport;
  const auto refinements = refine_poses(how.device, pairs, starts, {.method = method});
  if (!refinements) return tl::unexpected(refinements.error());
  std::vector<Pose> results = poses;
  for (std::size_t i = 0; i < results.size(); ++i)
    if (is_finite(poses[i])) results[i] = (*refinements)[i].T_reference_source;
  return results;
}

}  // namespace bitr::tool
