#include <algorithm>
#include <bitr/refine.hpp>
#include <cmath>
#include <memory>
#include <optional>
#include <string>

#include "api/internal.hpp"
#include "core/finite.hpp"
#include "core/guarded.hpp"
#include "refine/icp.hpp"
#include "refine/matching.hpp"
#include "refine/overlap.hpp"
#include "refine/score.hpp"
#include "refine/surface_icp.hpp"
#include "refine/transport.hpp"
#include "refine/vulkan_driver.hpp"

namespace bitr {

using namespace refine;

namespace {

// Transport is worth its time up to here; more points than that make no better pose.
constexpr std::size_t most_transported = 4'096;
// Points that a Vulkan device is given at once, unless one pair has more.
constexpr std::size_t most_together = 1 << 19;
// A pair with more is left to the CPU: a device binds 128 MiB at least, eight million points.
constexpr std::size_t most_on_device = std::size_t{1} << 22;
// This share of a proposal's overlap must have been near at the start.
constexpr double least_near = 0.5;

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

enum class Extent : std::uint8_t { score, all };

class Refiner : public Stepper {
 public:
  Refiner(const CloudPair& pair, const Pose& start, const RefineOptions& options, Extent extent,
          const Workers& workers)
      : pair_(pair),
        options_(options),
        extent_(extent),
        workers_(workers),
        source_(pair.source),
        reference_(pair.reference) {
    keep_common_normals(source_, reference_);
    if (!source_.has_normals()) phase_ = Phase::measure_start;
    result_.spacing = std::max(source_.spacing, reference_.spacing);
    result_.start = result_.proposal = start;
    before_ = centred(start);
  }

  Wanted wanted() override {
    if (phase_ == Phase::orient) return {match(source_, reference_, before_, {}, matches_)};
    if (phase_ == Phase::measure_start) return {measure(before_)};
    if (phase_ == Phase::propose) {
      if (Wanted wanted = method_->wanted(); !wanted.nothing()) return wanted;
      end_proposal();
    }
    if (phase_ == Phase::measure_proposal) return {measure(centred(result_.proposal))};
    return {};
  }

  void step() override {
    switch (phase_) {
      case Phase::orient:
        oriented_ = normals_are_oriented(matches_);
        matches_ = {};
        phase_ = Phase::measure_start;
        break;
      case Phase::measure_start:
        fit_before_ = fit_after_ = measurement_->fit();
        result_.score_before = fit_before_.score;
        result_.overlap_before = fit_before_.most_overlap;
        result_.reason = too_little_overlap(fit_before_, result_.spacing);
        phase_ = result_.reason.empty() && extent_ == Extent::all ? Phase::propose : Phase::done;
        if (phase_ == Phase::propose) begin_proposal();
        break;
      case Phase::propose:
        method_->step();
        break;
      case Phase::measure_proposal:
        fit_after_ = measurement_->fit();
        result_.reason = no_better(fit_before_, fit_after_);
        phase_ = Phase::done;
        break;
      case Phase::done:
        break;
    }
  }

  /// Once it is done.
  Refinement result() {
    result_.score_after = fit_after_.score;
    result_.improved = result_.reason.empty();
    result_.T_reference_source = result_.improved ? result_.proposal : result_.start;
    const Fit& fit = result_.improved ? fit_after_ : fit_before_;
    result_.overlap = fit.overlap;
    if (fit.inliers > 0) result_.rmse = fit.rmse;
    result_.workspace_bytes += source_.bytes() + reference_.bytes();
    return std::move(result_);
  }

 private:
  enum class Phase : std::uint8_t { orient, measure_start, propose, measure_proposal, done };

  std::vector<Search> measure(const Pose& pose) {
    return measurement_.emplace(source_, reference_, pose, oriented_).searches();
  }

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

  Pose centred(const Pose& pose) const { return refine::centred(pose, source_, reference_); }
  Pose given(const Pose& centred) const {
    return moved_by(reference_.centroid, 1) * centred * moved_by(source_.centroid, -1);
  }

  void begin_proposal() {
    if (options_.method == RefineMethod::icp)
      official() ? begin_official_icp() : begin_adaptive_icp();
    else
      official() ? begin_official_transport() : begin_adaptive_transport();
  }

  void end_proposal() {
    if (options_.method == RefineMethod::transport) {
      Pose pose = transport_.T_reference_source;
      for (double& value : pose.translation) value /= scale_;
      take(transport_, official() ? pose : given(pose));
    } else if (official()) {
      take(icp_, icp_.T_reference_source);
    } else {
      take(surface_icp_, given(surface_icp_.T));
    }
    const bool finite = is_finite(result_.proposal);
    if (finite && options_.within) result_.proposal = options_.within(result_.proposal);
    if (!finite) {
      result_.proposal = result_.start;
      result_.reason = no_better(fit_before_, fit_after_);
    }
    phase_ = finite ? Phase::measure_proposal : Phase::done;
  }

  template <class MethodResult>
  void take(const MethodResult& method, const Pose& proposal) {
    result_.proposal = proposal;
    result_.iterations = method.iterations;
    result_.converged = method.converged;
    result_.workspace_bytes = method.workspace_bytes;
  }

  void begin_official_icp() {
    IcpOptions options;
    options.keep = options_.keep.value_or(options.keep);
    options.most_iterations = options_.most_iterations.value_or(options.most_iterations);
    source_points_ = points_of(pair_.source.positions);
    official_icp_.emplace(points_of(pair_.reference.positions), options);
    method_ = official_icp_->stepper(source_points_, result_.start, icp_);
  }

  void begin_adaptive_icp() {
    SurfaceIcpOptions options;
    options.keep = options_.keep;
    options.oriented = oriented_;
    options.most_iterations = options_.most_iterations.value_or(options.most_iterations);
    method_ = surface_icp(source_, reference_, before_, options, surface_icp_);
  }

  void begin_official_transport() {
    source_points_ = points_of(pair_.source.positions);
    reference_points_ = points_of(pair_.reference.positions);
    begin_transport(result_.start, {TransportStage{}});
  }

  void begin_adaptive_transport() {
    // In spacings, so that one tolerance does for turns and shifts.
    const auto some = [&](const std::vector<Vec3d>& points, double scale) {
      std::vector<Vec3d> rows = every_so_many(points, most_transported);
      for (Vec3d& row : rows)
        for (double& value : row) value *= scale;
      return rows;
    };
    scale_ =
        1 / std::max(source_.thinned_spacing(most_transported), reference_.thinned_spacing(most_transported));
    source_points_ = some(source_.points, scale_);
    reference_points_ = some(reference_.points, scale_);
    source_normals_ = some(source_.normals, 1);
    reference_normals_ = some(reference_.normals, 1);
    Pose scaled = before_;
    for (double& value : scaled.translation) value *= scale_;
    begin_transport(scaled, narrowing_stages(source_.has_normals()));
  }

  void begin_transport(const Pose& start, std::vector<TransportStage> stages) {
    stages_ = std::move(stages);
    for (TransportStage& stage : stages_)
      stage.most_iterations = options_.most_iterations.value_or(stage.most_iterations);
    method_ = transport_stepper({source_points_, source_normals_}, {reference_points_, reference_normals_},
                                start, stages_, workers_, transport_);
  }

  bool official() const { return options_.protocol == RefineProtocol::official; }

  const CloudPair& pair_;
  const RefineOptions options_;
  const Extent extent_;
  const Workers workers_;
  Surface source_, reference_;
  Phase phase_ = Phase::orient;
  bool oriented_ = true;
  Pose before_;  // the start, between the centred clouds
  std::vector<Match> matches_;
  std::optional<Measurement> measurement_;
  Fit fit_before_, fit_after_;
  Refinement result_;

  // What the method works on and ends with.
  std::vector<Vec3d> source_points_, reference_points_, source_normals_, reference_normals_;
  double scale_ = 1;  // what the clouds' lengths were multiplied by
  std::vector<TransportStage> stages_;
  std::optional<Icp> official_icp_;
  std::unique_ptr<Stepper> method_;
  IcpResult icp_;
  SurfaceIcpResult surface_icp_;
  TransportResult transport_;
};

std::size_t points_of_pair(const CloudPair& pair) {
  return pair.source.positions.count + pair.reference.positions.count;
}

// Without a Vulkan device.
Refinement refined_here(const CloudPair& pair, const Pose& start, const RefineOptions& options, Extent extent,
                        const Workers& workers) {
  Refiner refiner(pair, start, options, extent, workers);
  drive(refiner, workers);
  return refiner.result();
}

// Refines as many pairs on the device as it holds at once; returns the first of those that are left.
std::size_t refine_together(const Device& device, std::span<const CloudPair> pairs,
                            std::span<const Pose> starts, const RefineOptions& options, std::size_t begin,
                            std::vector<Refinement>& results) {
  std::size_t end = begin;
  // Small clouds take as much memory as 64 points.
  for (std::size_t points = 0; end < pairs.size(); ++end) {
    for (const CloudView* cloud : {&pairs[end].source, &pairs[end].reference})
      points += std::max<std::size_t>(cloud->positions.count, 64);
    if (end > begin && points > most_together) break;
  }
  std::vector<std::unique_ptr<Refiner>> refiners(end - begin);
  Internal::pool(device).parallel_for(refiners.size(), 1, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i)
      refiners[i] =
          std::make_unique<Refiner>(pairs[begin + i], starts[begin + i], options, Extent::all, Workers{});
  });
  std::vector<Stepper*> steppers;
  for (const auto& refiner : refiners) steppers.push_back(refiner.get());
  drive(steppers, *Internal::context(device), Internal::pool(device));
  for (std::size_t i = 0; i < refiners.size(); ++i) results[begin + i] = refiners[i]->result();
  return end;
}

}  // namespace

double refine::overlap_at(const CloudPair& pair, const Pose& T_reference_source, const Workers& workers) {
  return refined_here(pair, T_reference_source, {}, Extent::score, workers).overlap_before;
}

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
    require_surfaces(pairs);
    for (std::size_t i = 0; i < starts.size(); ++i)
      if (!is_finite(starts[i])) refuse(pair_name(i, pairs.size()) + "the start is not finite");
    std::vector<Refinement> results(pairs.size());
    const auto refine_here = [&](std::size_t i, const Workers& workers) {
      results[i] = refined_here(pairs[i], starts[i], options, Extent::all, workers);
    };
    if (Internal::context(device)) {
      for (std::size_t begin = 0; begin < pairs.size();)
        if (points_of_pair(pairs[begin]) > most_on_device)
          refine_here(begin++, {&Internal::pool(device)});
        else
          begin = refine_together(device, pairs, starts, options, begin, results);
      return results;
    }
    for_each_pair(device, pairs.size(), refine_here);
    return results;
  });
}

Result<double> refinement_score(const Device& device, const CloudPair& pair, const Pose& T_reference_source) {
  return guarded([&]() -> Result<double> {
    require_surfaces({&pair, 1});
    if (!is_finite(T_reference_source)) refuse("the pose is not finite");
    const Workers workers{&Internal::pool(device)};
    if (!Internal::context(device) || points_of_pair(pair) > most_on_device)
      return refined_here(pair, T_reference_source, {}, Extent::score, workers).score_before;
    Refiner refiner(pair, T_reference_source, {}, Extent::score, workers);
    Stepper* stepper = &refiner;
    drive({&stepper, 1}, *Internal::context(device), Internal::pool(device));
    return refiner.result().score_before;
  });
}

}  // namespace bitr
