#include <bitr/confidence.hpp>

#include "api/plan.hpp"
#include "confidence/calibration.hpp"
#include "confidence/evidence.hpp"
#include "core/finite.hpp"
#include "core/guarded.hpp"
#include "refine/surface.hpp"

namespace bitr {
namespace {}  // namespace

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
        judged[i].reasons.emplace_back("the pose is not finite");
        return;
      }
      Evidence evidence = confidence::evidence_of_fit(pairs[i], poses[i], workers);
      if (!network.empty() && network[i]) {
        const NetworkEvidence& said = *network[i];
        evidence.rotation_gap = said.rotation_gap;
        evidence.rotation_spread = said.rotation_spread;
        evidence.translation_spread = said.translation_spread;
        if (said.T_reference_source.matrix() != poses[i].matrix())
          evidence.refined_by = rotation_error_degrees(poses[i], said.T_reference_source);
      }
      judged[i] = confidence::confidence_in(evidence);
      if (evidence.rotation_gap && *evidence.rotation_gap < least_rotation_gap) {
        judged[i].value = 0;
        judged[i].reasons.emplace(judged[i].reasons.begin(), "the rotation is not determined");
      }
    });
    return judged;
  });
}

}  // namespace bitr
