#include "solve/network.hpp"

#include "core/finite.hpp"

namespace bitr::solving {
namespace {

PointCloud shown(const Level& level, const Neighbours& near, Signs signs, std::size_t most) {
  const std::vector<Vec3d> normals = signed_normals(level, near, signs);
  const std::size_t count = std::min(most, level.size());
  PointCloud cloud;
  // Thinned points come from the middle outwards: every so many are an even sample.
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t at = i * level.size() / count;
    cloud.positions.push_back(level.points[at]);
    cloud.normals.push_back({static_cast<float>(normals[at][0]), static_cast<float>(normals[at][1]),
                             static_cast<float>(normals[at][2])});
  }
  return cloud;
}

}  // namespace

std::vector<Candidate> network_proposals(std::span<Plan* const> plans, const LevelPair& level,
                                         std::size_t points) {
  std::vector<Candidate> candidates;
  std::vector<Signs> rules = {Signs::outward, Signs::spread};
  if (level.source.given_normals && level.reference.given_normals) rules = {Signs::given};
  for (const Signs signs : rules) {
    const PointCloud source = shown(level.source, level.near_source, signs, points),
                     reference = shown(level.reference, level.near_reference, signs, points);
    const CloudPair pair = {source, reference};
    for (Plan* plan : plans) {
      const auto assemblies = assemble(*plan, {&pair, 1}, {.diagnostics = false});
      if (!assemblies || assemblies->front().status != Status::ok) continue;
      const Pose& T = assemblies->front().T_reference_source;
      if (is_finite(T)) candidates.push_back({.T = T, .from = plan->model().name()});
    }
  }
  return candidates;
}

}  // namespace bitr::solving
