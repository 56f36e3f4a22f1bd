#include "solve/ask.hpp"

#include <algorithm>
#include <bitr/assemble.hpp>
#include <bitr/confidence.hpp>
#include <bitr/io.hpp>

#include "api/internal.hpp"
#include "api/plan.hpp"
#include "core/centroid.hpp"
#include "core/finite.hpp"
#include "core/guarded.hpp"

namespace bitr::solving {
namespace {

// Points of all clouds that are sent to a device at once.
constexpr std::size_t most_asked_points = std::size_t{1} << 18;
// Of the first answer: networks are that vague where they do not know what they see, and are not asked about parts of it.
// On test shapes of their own kinds, down to gaps between the pieces, the least was 1.2.
constexpr double least_telling_gap = 1;

Vec3f single(const Vec3d& v) {
  return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}

/// A normal that is a zero vector is the level's where the level has one near.
void borrow_normals(PointCloud& cloud, const Level& level, const Neighbours& near) {
  const Signs signs = level.given_normals ? Signs::given : Signs::spread;
  const std::vector<Vec3d> normals = signed_normals(level, near, signs);
  const bool none = cloud.normals.empty();
  cloud.normals.resize(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (!none && cloud.normals[i] != Vec3f{}) continue;
    std::uint32_t nearest = 0;
    double squared = 0;
    level.tree->knnSearch(cloud.positions[i].data(), 1, &nearest, &squared);
    cloud.normals[i] = single(normals[nearest]);
  }
}

PointCloud shown(const Prepared& prepared, const Level& level, const Neighbours& near, const Model& model) {
  PointCloud all;
  all.positions = prepared.cloud.points;
  for (const Vec3d& normal : prepared.cloud.normals) all.normals.push_back(single(normal));
  const std::optional<PointRange> known = model.trained_points();
  if (known && all.size() > known->high) all = io::subsample(all, (known->low + known->high) / 2, 0);
  if (model.config().return_normals) borrow_normals(all, level, near);
  return all;
}

struct Shown {
  std::size_t question;
  PointCloud source, reference;
  CloudPair pair() const { return {source, reference}; }
  std::size_t points() const { return source.size() + reference.size(); }
};

std::vector<Confidence> judged(const Plan& plan, std::span<const CloudPair> pairs,
                               std::span<const Pose> poses,
                               std::span<const std::optional<NetworkEvidence>> evidence) {
  return value_or_throw(judge_poses(plan.device(), pairs, poses, evidence));
}

void ask_together(Plan& plan, const AskOptions& options, std::span<const Shown> shown,
                  std::vector<std::vector<Reply>>& replies) {
  std::vector<CloudPair> pairs;
  for (const Shown& one : shown) pairs.push_back(one.pair());
  const auto first = value_or_throw(assemble(plan, pairs, {.diagnostics = false}));
  const std::string name = plan.model().name();
  std::vector<std::size_t> telling;
  std::vector<CloudPair> asked;
  std::vector<Assembly> assemblies;
  for (std::size_t i = 0; i < shown.size(); ++i) {
    const Assembly& said = first[i];
    if (said.status != Status::ok || !is_finite(said.T_reference_source)) continue;
    if (said.diagnostics.rotation_gap < least_telling_gap) {
      replies[shown[i].question].push_back(
          {said.T_reference_source, 0, {"the network does not know such clouds"}, name});
      continue;
    }
    telling.push_back(i);
    asked.push_back(pairs[i]);
    assemblies.push_back(said);
  }
  if (asked.empty()) return;
  std::vector<std::optional<NetworkEvidence>> together(asked.size());
  if (options.answers > 0)
    together = value_or_throw(resample(plan, asked, assemblies, {.answers = options.answers}));
  std::vector<Pose> poses;
  for (std::size_t i = 0; i < asked.size(); ++i)
    poses.push_back(together[i] ? together[i]->T_reference_source : assemblies[i].T_reference_source);
  std::vector<Confidence> confidences = judged(plan, asked, poses, together);
  if (options.restriction.any()) {
    for (std::size_t i = 0; i < asked.size(); ++i) {
      const Vec3d centroid = centroid_of(asked[i].source.positions);
      poses[i] = restricted(options.restriction, poses[i], centroid).pose;
      if (together[i]) together[i]->T_reference_source = poses[i];
    }
    std::vector<Confidence> there = judged(plan, asked, poses, together);
    for (std::size_t i = 0; i < asked.size(); ++i) {
      // A pose is no more likely for being restricted.
      there[i].value = std::min(there[i].value, confidences[i].value);
      confidences[i] = std::move(there[i]);
    }
  }
  for (std::size_t i = 0; i < asked.size(); ++i)
    if (is_finite(poses[i]))
      replies[shown[telling[i]].question].push_back(
          {poses[i], confidences[i].value, std::move(confidences[i].reasons), name});
}

}  // namespace

std::vector<std::vector<Reply>> ask(const Device& device, std::span<const Model> models,
                                    const AskOptions& options, std::span<const Question> questions) {
  std::vector<std::vector<Reply>> replies(questions.size());
  for (const Model& model : models) {
    if (model.config().get_color) continue;
    std::vector<Shown> shown_to;
    for (std::size_t i = 0; i < questions.size(); ++i) {
      const Question& q = questions[i];
      Shown one{i, shown(q.source, q.level.source, q.level.near_source, model),
                shown(q.reference, q.level.reference, q.level.near_reference, model)};
      const std::size_t fewest = least_points(model.config());
      if (std::min(one.source.size(), one.reference.size()) >= fewest) shown_to.push_back(std::move(one));
    }
    for (std::size_t begin = 0, end; begin < shown_to.size(); begin = end) {
      std::size_t points = 0;
      for (end = begin; end < shown_to.size(); ++end) {
        if (end > begin && points + shown_to[end].points() > most_asked_points) break;
        points += shown_to[end].points();
      }
      auto plan = value_or_throw(make_plan(device, model, {end - begin, points}));
      ask_together(plan, options, std::span(shown_to).subspan(begin, end - begin), replies);
    }
  }
  return replies;
}

}  // namespace bitr::solving
