#include <algorithm>
#include <bitr/refine.hpp>
#include <cmath>
#include <memory>
#include <string>

#include "api/guarded.hpp"
#include "core/finite.hpp"
#include "refine/icp.hpp"
#include "refine/matching.hpp"
#include "refine/score.hpp"
#include "refine/surface_icp.hpp"
#include "refine/transport.hpp"

namespace bitr {

using namespace refine;

namespace {

constexpr std::size_t fewest_points = 3;
// Transport is worth its time up to here; more points than that make no better pose.
constexpr std::size_t most_transported = 4'096;
// Of a proposal's overlap, this much must have been near at the start.
constexpr double least_near = 0.5;

[[noreturn]] void refuse(const std::string& why) { throw Failure(ErrorCode::invalid_argument, why); }

void check(const CloudView& cloud, const std::string& which) {
  const Vec3View &positions = cloud.positions, &normals = cloud.normals;
  if (positions.count < fewest_points)
    refuse(which + ": " + std::to_string(positions.count) + " points; refinement needs at least " +
           std::to_string(fewest_points));
  if (!normals.empty() && normals.count != positions.count)
    refuse(which + ": " + std::to_string(normals.count) + " normals for " + std::to_string(positions.count) +
           " points");
  for (std::size_t i = 0; i < positions.count; ++i)
    if (!is_finite(positions[i])) refuse(which + ": point " + std::to_string(i) + " is not finite");
  for (std::size_t i = 0; i < normals.count; ++i)
    if (!is_finite(normals[i])) refuse(which + ": normal " + std::to_string(i) + " is not finite");
}

void check(const RefineOptions& options) {
  if (options.keep && !(*options.keep > 0 && *options.keep <= 1))
    refuse("keep " + std::to_string(*options.keep) + " is not above 0 and up to 1");
  if (!(options.least_overlap >= 0 && options.least_overlap <= 1))
    refuse("least_overlap " + std::to_string(options.least_overlap) + " is not in 0 … 1");
  if (options.keep && options.method != RefineMethod::icp)
    refuse("keep is of icp: transport has a slack for what has no counterpart");
  constexpr int most = 100'000;
  if (options.most_iterations && (*options.most_iterations < 1 || *options.most_iterations > most))
    refuse("most_iterations " + std::to_string(*options.most_iterations) + " is not in 1 … " +
           std::to_string(most));
}

std::string percent(double share) {
  std::string text = std::to_string(100 * share);
  return text.substr(0, text.find('.') + 2) + " %";
}

Pose moved_by(const Vec3d& by, double sign) {
  Pose pose;
  for (int a = 0; a < 3; ++a) pose.translation[a] = sign * by[a];
  return pose;
}

template <class T>
std::vector<T> every_so_many(const std::vector<T>& values, std::size_t most) {
  if (values.size() <= most) return values;
  std::vector<T> some(most);
  for (std::size_t i = 0; i < most; ++i) some[i] = values[i * values.size() / most];
  return some;
}

class Refiner {
 public:
  Refiner(const CloudPair& pair, const RefineOptions& options, const Workers& workers)
      : pair_(pair), options_(options), workers_(workers), source_(pair.source), reference_(pair.reference) {
    // With one side's alone there is nothing to compare.
    normals_ = source_.has_normals() && reference_.has_normals();
    if (!normals_) {
      source_.normals.clear();
      reference_.normals.clear();
    }
  }

  Refinement run(const Pose& start) {
    Refinement result;
    result.spacing = std::max(source_.spacing, reference_.spacing);
    result.start = result.proposal = start;
    const Pose before = centred(start);
    oriented_ = normals_are_oriented(source_, reference_, before, workers_);
    const Fit fit_before = measured(before);
    result.score_before = fit_before.score;
    result.overlap_before = fit_before.most_overlap;
    Fit fit_after = fit_before;
    result.reason = too_little_overlap(fit_before, result.spacing);
    if (result.reason.empty()) {
      propose(start, before, result);
      if (is_finite(result.proposal))
        fit_after = measured(centred(result.proposal));
      else
        result.proposal = start;
      result.reason = no_better(fit_before, fit_after);
    }
    result.score_after = fit_after.score;
    result.improved = result.reason.empty();
    result.T_reference_source = result.improved ? result.proposal : start;
    const Fit& fit = result.improved ? fit_after : fit_before;
    result.overlap = fit.overlap;
    if (fit.inliers > 0) result.rmse = fit.rmse;
    result.workspace_bytes += source_.bytes() + reference_.bytes();
    return result;
  }

  double score(const Pose& pose) {
    oriented_ = normals_are_oriented(source_, reference_, centred(pose), workers_);
    return measured(centred(pose)).score;
  }

 private:
  Fit measured(const Pose& pose) const { return measure(source_, reference_, pose, oriented_, workers_); }

  bool guarded_by_overlap() const {
    return options_.protocol == RefineProtocol::adaptive && options_.least_overlap > 0;
  }

  std::string too_little_overlap(const Fit& before, double spacing) const {
    if (spacing <= 0) return "all points of the clouds are at one place";
    if (!guarded_by_overlap() || before.most_overlap >= options_.least_overlap) return {};
    return "at the start " + percent(before.most_overlap) + " of the points have a counterpart, less than " +
           percent(options_.least_overlap) + ": there is too little to refine on";
  }

  std::string no_better(const Fit& before, const Fit& after) const {
    if (!(after.score > before.score)) return "the proposal's score is no better";
    // Where clouds only meet, any method would pull them over one another.
    if (guarded_by_overlap() && before.most_near < least_near * after.most_overlap)
      return "the proposal's overlap of " + percent(after.most_overlap) +
             " is not the start's: the clouds were pulled over one another";
    return {};
  }

  Pose centred(const Pose& pose) const {
    // t' = R c_source + t − c_reference, without the detour over two products.
    Pose result = pose;
    result.translation = pose.apply(source_.centroid);
    for (int a = 0; a < 3; ++a) result.translation[a] -= reference_.centroid[a];
    return result;
  }
  Pose given(const Pose& centred) const {
    return moved_by(reference_.centroid, 1) * centred * moved_by(source_.centroid, -1);
  }

  void propose(const Pose& start, const Pose& before, Refinement& result) {
    const bool official = options_.protocol == RefineProtocol::official;
    if (options_.method == RefineMethod::icp)
      official ? official_icp(start, result) : adaptive_icp(before, result);
    else
      official ? official_transport(start, result) : adaptive_transport(before, result);
  }

  void official_icp(const Pose& start, Refinement& result) {
    IcpOptions options;
    options.keep = options_.keep.value_or(options.keep);
    options.most_iterations = options_.most_iterations.value_or(options.most_iterations);
    const std::vector<Vec3d> source = points_of(pair_.source.positions);
    const IcpResult icp = Icp(points_of(pair_.reference.positions), options).align(source, start);
    result.proposal = icp.T_reference_source;
    result.iterations = icp.iterations;
    result.converged = icp.converged;
    result.workspace_bytes = icp.workspace_bytes;
  }

  void adaptive_icp(const Pose& before, Refinement& result) {
    SurfaceIcpOptions options;
    options.keep = options_.keep;
    options.oriented = oriented_;
    options.most_iterations = options_.most_iterations.value_or(options.most_iterations);
    const SurfaceIcpResult icp = surface_icp(source_, reference_, before, options, workers_);
    result.proposal = given(icp.T);
    result.iterations = icp.iterations;
    result.converged = icp.converged;
    result.workspace_bytes = icp.workspace_bytes;
  }

  void official_transport(const Pose& start, Refinement& result) {
    TransportStage stage;
    stage.most_iterations = options_.most_iterations.value_or(stage.most_iterations);
    const std::vector<Vec3d> source = points_of(pair_.source.positions),
                             reference = points_of(pair_.reference.positions);
    keep(transport({source, {}}, {reference, {}}, start, {&stage, 1}, workers_), result);
    result.proposal = result.T_reference_source;
  }

  void adaptive_transport(const Pose& before, Refinement& result) {
    // In spacings, so that one tolerance does for turns and shifts.
    const auto some = [&](const std::vector<Vec3d>& points, double scale) {
      std::vector<Vec3d> rows = every_so_many(points, most_transported);
      for (Vec3d& row : rows)
        for (double& value : row) value *= scale;
      return rows;
    };
    const double scale =
        1 / std::max(source_.thinned_spacing(most_transported), reference_.thinned_spacing(most_transported));
    const auto source = some(source_.points, scale), reference = some(reference_.points, scale);
    const auto source_normals = some(source_.normals, 1), reference_normals = some(reference_.normals, 1);
    Pose scaled = before;
    for (double& value : scaled.translation) value *= scale;
    auto stages = narrowing_stages(normals_);
    for (TransportStage& stage : stages)
      stage.most_iterations = options_.most_iterations.value_or(stage.most_iterations);
    keep(transport({source, source_normals}, {reference, reference_normals}, scaled, stages, workers_),
         result);
    for (double& value : result.T_reference_source.translation) value /= scale;
    result.proposal = given(result.T_reference_source);
  }

  static void keep(const TransportResult& transport, Refinement& result) {
    result.T_reference_source = transport.T_reference_source;
    result.iterations = transport.iterations;
    result.converged = transport.converged;
    result.workspace_bytes = transport.workspace_bytes;
  }

  const CloudPair& pair_;
  const RefineOptions& options_;
  const Workers& workers_;
  Surface source_, reference_;
  bool normals_ = false, oriented_ = true;
};

std::string name_of(std::size_t pair, std::size_t pairs) {
  return pairs > 1 ? "pair " + std::to_string(pair) + ": " : "";
}

}  // namespace

std::string_view name(RefineMethod method) { return method == RefineMethod::icp ? "icp" : "ot"; }

std::string_view name(RefineProtocol protocol) {
  return protocol == RefineProtocol::official ? "official" : "default";
}

Result<std::vector<Refinement>> refine_poses(const Device& device, std::span<const CloudPair> pairs,
                                             std::span<const Pose> starts, const RefineOptions& options) {
  return guarded([&]() -> Result<std::vector<Refinement>> {
    check(options);
    if (pairs.size() != starts.size())
      refuse(std::to_string(starts.size()) + " starts for " + std::to_string(pairs.size()) + " pairs");
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const std::string which = name_of(i, pairs.size());
      check(pairs[i].source, which + "source");
      check(pairs[i].reference, which + "reference");
      if (!is_finite(starts[i])) refuse(which + "the start is not finite");
    }
    std::vector<Refinement> results(pairs.size());
    // One pair on all threads, or every thread with pairs of its own.
    const bool alone = pairs.size() < device.threads();
    const Workers workers{alone ? &device.pool() : nullptr};
    const auto run = [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i)
        results[i] = Refiner(pairs[i], options, workers).run(starts[i]);
    };
    if (alone)
      run(0, pairs.size());
    else
      device.pool().parallel_for(pairs.size(), 1, run);
    return results;
  });
}

Result<double> refinement_score(const Device& device, const CloudPair& pair, const Pose& T_reference_source) {
  return guarded([&]() -> Result<double> {
    check(pair.source, "source");
    check(pair.reference, "reference");
    return Refiner(pair, {}, Workers{&device.pool()}).score(T_reference_source);
  });
}

}  // namespace bitr
