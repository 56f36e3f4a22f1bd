#include "solve/propose.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>

#include "refine/principal_axes.hpp"
#include "refine/rigid_fit.hpp"

namespace bitr::solving {
namespace {

constexpr std::size_t most_pairings = 2000, most_hypotheses = 24;

// The pairings of several radii in one list, each radius's best first and in turn; what several found counts once.
std::vector<Pairing> pooled(std::vector<std::vector<Pairing>> lists) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::size_t> ranks;
  for (std::vector<Pairing>& list : lists) {
    std::stable_sort(list.begin(), list.end(),
                     [](const Pairing& a, const Pairing& b) { return a.distance < b.distance; });
    for (std::size_t k = 0; k < list.size(); ++k) {
      const auto [place, fresh] = ranks.emplace(std::pair(list[k].source, list[k].reference), k);
      if (!fresh) place->second = std::min(place->second, k);
    }
  }
  std::vector<Pairing> all;
  for (const auto& [points, rank] : ranks)
    all.push_back({points.first, points.second, static_cast<float>(rank)});
  std::stable_sort(all.begin(), all.end(),
                   [](const Pairing& a, const Pairing& b) { return a.distance < b.distance; });
  if (all.size() > most_pairings) all.resize(most_pairings);
  return all;
}

}  // namespace

Proposer::Proposer(const LevelPair& level, ThreadPool& pool) : level_(level), pool_(pool) {}

const Proposer::Described& Proposer::described(Signs signs) {
  if (const auto found = described_.find(signs); found != described_.end()) return found->second;
  std::vector<double> radii;
  for (const double radius : descriptor_radii) radii.push_back(radius * level_.source.resolution);
  const auto of = [&](const Level& level, const Neighbours& near) {
    return describe(level, near, signed_normals(level, near, signs), radii, pool_);
  };
  return described_
      .emplace(signs,
               Described{of(level_.source, level_.near_source), of(level_.reference, level_.near_reference)})
      .first->second;
}

std::vector<Candidate> Proposer::of_matches(SignRule rule) {
  const Described& found = described(rule.signs);
  std::vector<std::vector<Pairing>> lists;
  for (std::size_t r = 0; r < found.source.size(); ++r)
    lists.push_back(mutual_nearest(found.source[r],
                                   rule.facing ? flipped(found.reference[r]) : found.reference[r], pool_));
  std::vector<Candidate> candidates;
  for (const Hypothesis& h :
       consensus(level_.source, level_.reference, pooled(std::move(lists)), most_hypotheses, pool_))
    candidates.push_back({.T = h.T, .support = h.support, .from = "matches"});
  return candidates;
}

std::vector<Candidate> Proposer::of_axes() const {
  std::vector<Candidate> candidates;
  for (const Pose& T : refine::align_principal_axes(level_.source.points, level_.reference.points))
    candidates.push_back({.T = T, .from = "principal axes"});
  return candidates;
}

std::vector<Candidate> turned_over(const LevelPair& level, const Candidate& candidate) {
  std::vector<Eigen::Vector3d> touching;
  for (const Vec3d& point : level.source.points)
    if (nearest_within(level.reference, candidate.T.apply(point), 1.5 * level.source.resolution).found())
      touching.push_back(vector(point));
  if (touching.size() < 3) return {};
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const auto& p : touching) middle += p / static_cast<double>(touching.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const auto& p : touching) scatter += (p - middle) * (p - middle).transpose();
  const Eigen::Matrix3d axes = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(scatter).eigenvectors();
  std::vector<Candidate> result;
  for (int a = 0; a < 3; ++a) {
    const Eigen::Matrix3d R = 2 * axes.col(a) * axes.col(a).transpose() - Eigen::Matrix3d::Identity();
    result.push_back({.T = candidate.T * refine::pose_of(R, middle - R * middle), .from = candidate.from});
  }
  return result;
}

}  // namespace bitr::solving
