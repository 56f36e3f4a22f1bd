#include <algorithm>
#include <bitr/solve.hpp>

#include "api/internal.hpp"
#include "core/guarded.hpp"
#include "refine/surface.hpp"
#include "solve/belief.hpp"
#include "solve/network.hpp"
#include "solve/pipeline.hpp"
#include "solve/reasons.hpp"

namespace bitr {
namespace {

using namespace solving;

constexpr std::size_t fewest_points = 3;

Prepared prepare_or_refuse(const CloudView& cloud, const std::string& which) {
  const auto refuse = [&](const std::string& why) {
    throw Failure(ErrorCode::invalid_argument, which + ": " + why);
  };
  if (!cloud.normals.empty() && cloud.normals.count != cloud.positions.count)
    refuse(std::to_string(cloud.normals.count) + " normals for " + std::to_string(cloud.positions.count) +
           " points");
  Prepared prepared = prepare(cloud);
  if (prepared.cloud.points.size() < fewest_points)
    refuse(std::to_string(prepared.cloud.points.size()) + " finite points; at least " +
           std::to_string(fewest_points) + " are needed");
  return prepared;
}

/// Of the clouds as given.
Pose uncentred(const Pose& T, const Vec3d& source, const Vec3d& reference) {
  Pose result = T;
  const Vec3d turned = T.rotate(source);
  for (int a = 0; a < 3; ++a) result.translation[a] = T.translation[a] - turned[a] + reference[a];
  return result;
}

SolveEvidence evidence_of(const Settled& settled, std::size_t i) {
  const Candidate& c = settled.poses[i];
  const Fit& f = c.fit;
  SolveEvidence e;
  e.score = f.score;
  e.source_overlap = f.source.near;
  e.reference_overlap = f.reference.near;
  e.residual = std::max(f.source.residual, f.reference.residual);
  e.normals = std::min(f.source.cosine, f.reference.cosine);
  e.conflict = conflict_share(f);
  e.slack = i < settled.slacks.size() ? settled.slacks[i] : 1;
  e.margin = i == 0 ? margin(settled.poses) : f.score > 0 ? 1 - settled.poses[0].fit.score / f.score : 0;
  e.support = c.support;
  return e;
}

Solution solve_pair(const CloudPair& pair, const std::string& which, const SolveOptions& options,
                    ThreadPool& pool) {
  const Prepared source = prepare_or_refuse(pair.source, which + "source"),
                 reference = prepare_or_refuse(pair.reference, which + "reference");
  Solution solution;
  solution.source_spacing = source.spacing;
  solution.reference_spacing = reference.spacing;
  solution.source_dropped = source.dropped;
  solution.reference_dropped = reference.dropped;
  solution.best.T_reference_source = uncentred({}, source.centroid, reference.centroid);
  const auto refuse = [&](std::string why) {
    solution.reasons = {std::move(why)};
    return solution;
  };
  if (std::string why =
          hopeless(source, reference, source.cloud.points.size(), reference.cloud.points.size());
      !why.empty())
    return refuse(std::move(why));
  MoreProposals networks;
  if (!options.networks.empty())
    networks = [&](const LevelPair& level) {
      return network_proposals(options.networks, level, options.network_points);
    };
  const Settled settled = find_poses(source, reference, options.geometry, networks, pool);
  solution.resolution = settled.level->source.resolution;
  for (std::size_t i = 0; i < std::min(settled.poses.size(), 1 + options.most_alternatives); ++i) {
    SolvedPose pose{uncentred(settled.poses[i].T, source.centroid, reference.centroid),
                    settled.confidences[i], evidence_of(settled, i), settled.poses[i].from};
    if (i == 0)
      solution.best = std::move(pose);
    else
      solution.alternatives.push_back(std::move(pose));
  }
  if (std::string why =
          hopeless(source, reference, settled.level->source.size(), settled.level->reference.size());
      !why.empty()) {
    solution.best.confidence = 0;
    for (SolvedPose& other : solution.alternatives) other.confidence = 0;
    return refuse(std::move(why));
  }
  if (settled.poses.empty()) return refuse("no part of one cloud looks like one of the other");
  solution.reasons = reasons(solution);
  return solution;
}

}  // namespace

Result<std::vector<Solution>> solve(const Device& device, std::span<const CloudPair> pairs,
                                    const SolveOptions& options) {
  return guarded([&]() -> Result<std::vector<Solution>> {
    std::vector<Solution> solutions;
    for (std::size_t i = 0; i < pairs.size(); ++i)
      solutions.push_back(
          solve_pair(pairs[i], refine::pair_name(i, pairs.size()), options, Internal::pool(device)));
    return solutions;
  });
}

}  // namespace bitr
