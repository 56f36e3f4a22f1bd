#include <algorithm>
#include <bitr/solve.hpp>

#include "api/internal.hpp"
#include "core/finite.hpp"
#include "core/guarded.hpp"
#include "refine/surface.hpp"
#include "solve/belief.hpp"
#include "solve/reasons.hpp"
#include "solve/weigh.hpp"

namespace bitr {
namespace {

using namespace solving;

constexpr std::size_t fewest_points = 3;

Prepared prepare_or_refuse(const CloudView& cloud, const std::optional<Vec3d>& viewpoint,
                           const std::string& which) {
  const auto refuse = [&](const std::string& why) {
    throw Failure(ErrorCode::invalid_argument, which + ": " + why);
  };
  if (!cloud.normals.empty() && cloud.normals.count != cloud.positions.count)
    refuse(std::to_string(cloud.normals.count) + " normals for " + std::to_string(cloud.positions.count) +
           " points");
  if (viewpoint && !is_finite(*viewpoint)) refuse("its viewpoint is not finite");
  Prepared prepared = prepare(cloud, viewpoint);
  if (prepared.cloud.points.size() < fewest_points)
    refuse(std::to_string(prepared.cloud.points.size()) + " finite points; at least " +
           std::to_string(fewest_points) + " are needed");
  return prepared;
}

std::vector<Model> models_of(const SolveOptions& options) {
  if (options.models) return *options.models;
  std::vector<Model> models;
  for (const ShippedModel& shipped : shipped_models())
    models.push_back(value_or_throw(shipped_model(shipped.name)));
  return models;
}

/// Of the clouds as given.
Pose uncentred(const Pose& T, const Vec3d& source, const Vec3d& reference) {
  Pose result = T;
  const Vec3d turned = T.rotate(source);
  for (int a = 0; a < 3; ++a) result.translation[a] = T.translation[a] - turned[a] + reference[a];
  return result;
}

SolveEvidence evidence_of(const Fit& f) {
  SolveEvidence e;
  e.score = f.score;
  e.source_overlap = f.source.near;
  e.reference_overlap = f.reference.near;
  e.residual = std::max(f.source.residual, f.reference.residual);
  e.normals = std::min(f.source.cosine, f.reference.cosine);
  e.conflict = conflict_share(f);
  e.slack = 1;
  return e;
}

SolvedPose settled_pose(const Work& work, std::size_t i) {
  const Settled& settled = work.settled;
  const Candidate& c = settled.poses[i];
  SolvedPose pose;
  pose.T_reference_source = uncentred(c.T, work.source.centroid, work.reference.centroid);
  pose.confidence = settled.confidences[i];
  pose.proposal = c.from;
  SolveEvidence& e = pose.evidence = evidence_of(c.fit);
  if (i < settled.slacks.size()) e.slack = settled.slacks[i];
  e.margin = i == 0            ? margin(settled.poses)
             : c.fit.score > 0 ? 1 - settled.poses[0].fit.score / c.fit.score
                               : 0;
  e.support = c.support;
  return pose;
}

SolvedPose replied_pose(const Work& work, const Reply& reply) {
  SolvedPose pose;
  pose.T_reference_source = uncentred(reply.T, work.source.centroid, work.reference.centroid);
  pose.confidence = reply.confidence;
  pose.within_degrees = 20;
  pose.within_share = 0.1;
  pose.proposal = reply.model;
  pose.evidence = evidence_of(fit(work.level().source, work.level().reference, reply.T));
  return pose;
}

Work prepare_pair(const CloudPair& pair, const std::string& which) {
  Work work{prepare_or_refuse(pair.source, pair.source_viewpoint, which + "source"),
            prepare_or_refuse(pair.reference, pair.reference_viewpoint, which + "reference"),
            {}};
  work.hopeless = hopeless(work.source, work.reference, work.source.cloud.points.size(),
                           work.reference.cloud.points.size());
  return work;
}

void settle(Work& work, const SolveOptions& options, ThreadPool& pool) {
  if (!work.hopeless.empty()) return;
  work.settled = find_poses(work.source, work.reference, options.geometry, pool);
  if (options.restriction.any()) work.settled = within(options.restriction, std::move(work.settled), pool);
  work.hopeless =
      hopeless(work.source, work.reference, work.level().source.size(), work.level().reference.size());
}

struct Ranked {
  SolvedPose pose;
  Pose centred;
  const Reply* reply = nullptr;  ///< a network's, as it gave it
};

/// Most likely first, none like another before it. The settled poses stand together against a network.
std::vector<Ranked> ranked(const Work& work) {
  std::vector<Ranked> all;
  for (std::size_t i = 0; i < work.settled.poses.size(); ++i)
    all.push_back({settled_pose(work, i), work.settled.poses[i].T});
  for (const Reply& reply : work.replies) all.push_back({replied_pose(work, reply), reply.T, &reply});
  const double surfaces = together(work.settled);
  const auto first = [&](const Ranked& one) { return one.reply ? one.pose.confidence : surfaces; };
  std::stable_sort(all.begin(), all.end(), [&](const Ranked& a, const Ranked& b) {
    if (first(a) != first(b)) return first(a) > first(b);
    return a.pose.confidence > b.pose.confidence;
  });
  const Motion motion(work.level().source);
  std::vector<Ranked> some;
  for (Ranked& one : all) {
    const bool known = std::any_of(some.begin(), some.end(), [&](const Ranked& other) {
      return motion.between(one.centred, other.centred) <= distinct * work.level().source.resolution;
    });
    if (known) continue;
    // Nothing is likelier than what is returned first.
    if (!some.empty()) one.pose.confidence = std::min(one.pose.confidence, some[0].pose.confidence);
    some.push_back(std::move(one));
  }
  return some;
}

Solution solution_of(const Work& work, const SolveOptions& options) {
  Solution solution;
  solution.source_spacing = work.source.spacing;
  solution.reference_spacing = work.reference.spacing;
  solution.source_dropped = work.source.dropped;
  solution.reference_dropped = work.reference.dropped;
  solution.best.T_reference_source = uncentred({}, work.source.centroid, work.reference.centroid);
  if (work.settled.level) solution.resolution = work.level().source.resolution;
  const Reply* reply = nullptr;
  if (work.settled.level) {
    auto poses = ranked(work);
    for (std::size_t i = 0; i < std::min(poses.size(), 1 + options.most_alternatives); ++i) {
      if (!work.hopeless.empty()) poses[i].pose.confidence = 0;
      if (i > 0) {
        solution.alternatives.push_back(std::move(poses[i].pose));
        continue;
      }
      solution.best = std::move(poses[i].pose);
      reply = poses[i].reply;
    }
  }
  if (!work.hopeless.empty())
    solution.reasons = {work.hopeless};
  else if (solution.best.proposal.empty())
    solution.reasons = {"no part of one cloud looks like one of the other"};
  else
    solution.reasons = reply ? reply->reasons : reasons(solution);
  if (options.restriction.any()) {
    solution.restricted =
        restricted(options.restriction, solution.best.T_reference_source, work.source.centroid);
    solution.best.T_reference_source = solution.restricted->pose;
    if (std::string problem = solution.restricted->problem(); !problem.empty()) {
      solution.best.confidence = 0;
      solution.reasons.insert(solution.reasons.begin(), std::move(problem));
    }
  }
  return solution;
}

}  // namespace

Result<std::vector<Solution>> solve(const Device& device, std::span<const CloudPair> pairs,
                                    const SolveOptions& options) {
  return guarded([&]() -> Result<std::vector<Solution>> {
    ThreadPool& pool = Internal::pool(device);
    std::vector<Work> works;
    std::vector<std::size_t> in_doubt;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      works.push_back(prepare_pair(pairs[i], refine::pair_name(i, pairs.size())));
      settle(works[i], options, pool);
      if (works[i].in_doubt()) in_doubt.push_back(i);
    }
    const std::vector<Model> models = in_doubt.empty() ? std::vector<Model>() : models_of(options);
    if (!models.empty()) {
      std::vector<Question> questions;
      for (const std::size_t i : in_doubt)
        questions.push_back({works[i].source, works[i].reference, works[i].level()});
      auto replies = ask(device, models, {options.answers, options.restriction}, questions);
      for (std::size_t k = 0; k < in_doubt.size(); ++k)
        take_replies(works[in_doubt[k]], std::move(replies[k]), options, pool);
    }
    std::vector<Solution> solutions;
    for (const Work& work : works) solutions.push_back(solution_of(work, options));
    return solutions;
  });
}

}  // namespace bitr
