#include <algorithm>
#include <bitr/confidence.hpp>
#include <bitr/io.hpp>
#include <cmath>
#include <tuple>

#include "api/guarded.hpp"
#include "api/plan.hpp"
#include "confidence/calibration.hpp"
#include "confidence/evidence.hpp"
#include "core/finite.hpp"
#include "core/median.hpp"
#include "refine/surface.hpp"

namespace bitr {
namespace {

constexpr double most_of_cloud = 0.9;

[[noreturn]] void refuse(const std::string& why) { throw Failure(ErrorCode::invalid_argument, why); }

void check(const ResampleOptions& options) {
  if (options.answers < 1 || options.answers > 100)
    refuse("answers " + std::to_string(options.answers) + " is not in 1 … 100");
  if (!(options.share > 0 && options.share < 1))
    refuse("share " + std::to_string(options.share) + " is not above 0 and below 1");
}

// Points of a part; empty where it would be almost the whole.
std::optional<std::size_t> part_size(const CloudView& cloud, const Model& model,
                                     const ResampleOptions& options) {
  const auto points = static_cast<double>(cloud.positions.count);
  const auto wanted = static_cast<std::size_t>(options.share * points);
  const std::size_t size = std::max(std::min(wanted, most_resampled), least_points(model.config()));
  if (static_cast<double>(size) > most_of_cloud * points && size > wanted) return {};
  return size;
}

struct Parted {
  std::size_t pair = 0, source = 0, reference = 0;  ///< and points of its parts
  std::vector<double> angles;
};

}  // namespace

Result<std::vector<std::optional<NetworkEvidence>>> resample(Plan& plan, std::span<const CloudPair> pairs,
                                                             std::span<const Assembly> assemblies,
                                                             const ResampleOptions& options) {
  using Found = std::vector<std::optional<NetworkEvidence>>;
  return guarded([&]() -> Result<Found> {
    check(options);
    if (pairs.size() != assemblies.size())
      refuse(std::to_string(assemblies.size()) + " assemblies for " + std::to_string(pairs.size()) +
             " pairs");
    // What the plan tells of its last assemble() is the caller's.
    Plan::Impl& impl = plan.impl();
    auto told = std::tie(impl.timings, impl.profile, impl.passes, impl.began);
    const std::tuple kept = {impl.timings, impl.profile, impl.passes, impl.began};
    Found found(pairs.size());
    std::vector<Parted> parted;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const auto source = part_size(pairs[i].source, plan.model(), options),
                 reference = part_size(pairs[i].reference, plan.model(), options);
      if (assemblies[i].status != Status::failed && source && reference)
        parted.push_back({i, *source, *reference, {}});
    }
    for (int answer = 0; answer < options.answers; ++answer) {
      std::vector<PointCloud> parts;
      for (const Parted& of : parted) {
        // By two seeds: points that are in both clouds must not stay partners.
        const std::uint64_t seed = options.seed + 2 * static_cast<std::uint64_t>(answer);
        parts.push_back(io::subsample(pairs[of.pair].source, of.source, seed));
        parts.push_back(io::subsample(pairs[of.pair].reference, of.reference, seed + 1));
      }
      std::vector<CloudPair> part_pairs;
      for (std::size_t i = 0; i < parted.size(); ++i) part_pairs.push_back({parts[2 * i], parts[2 * i + 1]});
      const auto answers = value_or_throw(assemble(plan, part_pairs, {.diagnostics = false}));
      for (std::size_t i = 0; i < parted.size(); ++i)
        parted[i].angles.push_back(
            answers[i].status == Status::failed
                ? 180
                : rotation_error_degrees(answers[i].T_reference_source,
                                         assemblies[parted[i].pair].T_reference_source));
    }
    for (Parted& of : parted) {
      const Assembly& assembly = assemblies[of.pair];
      found[of.pair] = {assembly.T_reference_source, assembly.diagnostics.rotation_gap,
                        median(std::move(of.angles))};
    }
    told = kept;
    return found;
  });
}

Result<std::vector<Confidence>> judge_poses(const Device& device, std::span<const CloudPair> pairs,
                                            std::span<const Pose> poses,
                                            std::span<const std::optional<NetworkEvidence>> network) {
  return guarded([&]() -> Result<std::vector<Confidence>> {
    if (pairs.size() != poses.size() || (!network.empty() && pairs.size() != network.size()))
      refuse(std::to_string(poses.size()) + " poses and evidence of " + std::to_string(network.size()) +
             " for " + std::to_string(pairs.size()) + " pairs");
    refine::require_surfaces(pairs);
    std::vector<Confidence> judged(pairs.size());
    refine::for_each_pair(device, pairs.size(), [&](std::size_t i, const refine::Workers& workers) {
      if (!is_finite(poses[i])) {
        judged[i].reasons = {"the pose is not finite"};
        return;
      }
      Evidence evidence = confidence::evidence_of_fit(pairs[i], poses[i], workers);
      if (!network.empty() && network[i]) {
        const NetworkEvidence& answer = *network[i];
        evidence.rotation_gap = answer.rotation_gap;
        evidence.spread = answer.spread;
        if (answer.T_reference_source.matrix() != poses[i].matrix())
          evidence.refined_by = rotation_error_degrees(poses[i], answer.T_reference_source);
      }
      judged[i] = confidence::judged(evidence);
      if (evidence.rotation_gap && *evidence.rotation_gap < least_rotation_gap) {
        judged[i].value = 0;
        judged[i].reasons.insert(judged[i].reasons.begin(), "the rotation is not determined");
      }
    });
    return judged;
  });
}

}  // namespace bitr
