#include "solve/weigh.hpp"

#include <algorithm>
#include <numeric>

#include "solve/belief.hpp"

namespace bitr::solving {
namespace {

// Only a copy fits like this.
constexpr double telling_score = 0.9;
// Poses that turn the source less than 20° against each other are one network's answer, more or less well.
constexpr double same_answer = 0.35;
// A network's answer that brings more of the points over the inside of the other cloud's surface is none; less than the
// first takes nothing.
constexpr double least_conflict = 0.15, most_conflict = 0.45;
// What a network makes of estimated normals was never calibrated.
constexpr double with_estimated_normals = 0.5;

void lead_with(Reply& reply, std::string why) {
  reply.reasons.push_back(std::move(why));
  std::rotate(reply.reasons.begin(), reply.reasons.end() - 1, reply.reasons.end());
}

/// A network knows what it was trained on; of anything else it is as sure. The surfaces say what they can against it.
void doubt(Work& work) {
  for (Reply& reply : work.replies) {
    const Fit f = fit(work.level().source, work.level().reference, reply.T);
    const double conflict = f.source.conflict + f.reference.conflict;
    const double left = std::clamp((most_conflict - conflict) / (most_conflict - least_conflict), 0.0, 1.0);
    if (left < 1) lead_with(reply, "parts of the clouds would be inside each other");
    reply.confidence *= left;
    if (work.has_normals()) continue;
    reply.confidence *= with_estimated_normals;
    lead_with(reply, "the clouds have no normals: a network was shown estimated ones");
  }
}

/// Answers that exclude each other share what is certain. A network that agrees with a settled pose that is sure has
/// nothing to add: what lies on the surfaces is the more exact.
void weigh(Work& work) {
  Settled& settled = work.settled;
  const Motion motion(work.level().source);
  const auto differ = [&](const Pose& a, const Pose& b) {
    return motion.between(a, b) > same_answer * motion.radius();
  };
  if (!settled.poses.empty() && settled.confidences[0] >= sure)
    std::erase_if(work.replies, [&](const Reply& reply) { return !differ(reply.T, settled.poses[0].T); });
  std::vector<Pose> poses;
  std::vector<double> confidences;
  if (!settled.poses.empty()) {
    poses.push_back(settled.poses[0].T);
    confidences.push_back(together(settled));
  }
  for (const Reply& reply : work.replies) {
    poses.push_back(reply.T);
    confidences.push_back(reply.confidence);
  }
  const std::vector<double> shared =
      shared_by_odds(confidences, [&](std::size_t i, std::size_t j) { return differ(poses[i], poses[j]); });
  std::size_t at = 0;
  if (!settled.poses.empty()) {
    const double left = confidences[0] > 0 ? shared[0] / confidences[0] : 1;
    for (double& confidence : settled.confidences) confidence *= left;
    ++at;
  }
  for (Reply& reply : work.replies) reply.confidence = shared[at++];
}

}  // namespace

bool Work::in_doubt() const {
  if (!hopeless.empty()) return false;
  if (settled.confidences.empty() || settled.confidences[0] < sure) return true;
  return has_normals() && settled.poses[0].fit.score < telling_score;
}

double together(const Settled& settled) {
  return std::accumulate(settled.confidences.begin(), settled.confidences.end(), 0.0);
}

void take_replies(Work& work, std::vector<Reply> replies, const SolveOptions& options, ThreadPool& pool) {
  if (replies.empty()) return;
  if (options.geometry) {
    std::vector<Candidate> candidates;
    for (const Reply& reply : replies) candidates.push_back({.T = reply.T, .from = reply.model});
    work.settled = with_more(std::move(work.settled), std::move(candidates), pool);
    if (options.restriction.any()) work.settled = within(options.restriction, std::move(work.settled), pool);
  }
  work.replies = std::move(replies);
  doubt(work);
  weigh(work);
}

}  // namespace bitr::solving
