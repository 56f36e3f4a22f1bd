#include "solve/belief.hpp"

#include <algorithm>
#include <cmath>

namespace bitr::solving {
namespace {

// Where a sign of a true pose tells as much for it as against it, and how far it takes to be clear.
struct Sign {
  double middle, width;
  double of(double value) const { return 1 / (1 + std::exp((middle - value) / width)); }
};
constexpr Sign by_score = {0.19, 0.015};
constexpr double margin_middle = 0.16, margin_width = 0.04;
// Scores of few points are chance: the best of many poses leads by a multiple of 1/√(points that touch).
constexpr double chance = 2;
constexpr double conflict_weight = 2;
// From here on a surface that slides loses belief; at 1 it has none.
constexpr double firm = 0.8;
constexpr double enough_touching = 50;
// Nothing that looks at two clouds alone is surer.
constexpr double most_certain = 0.999;

double by_margin(const std::vector<Candidate>& poses) {
  const double touching = std::max(1.0, poses[0].fit.touching);
  return Sign{margin_middle + chance / std::sqrt(touching), margin_width}.of(margin(poses));
}

double by_fit(const Fit& fit) {
  return by_score.of(fit.score * std::max(0.0, 1 - conflict_weight * conflict_share(fit))) *
         std::min(1.0, fit.touching / enough_touching);
}

}  // namespace

double conflict_share(const Fit& fit) {
  const double conflict = fit.source.conflict + fit.reference.conflict,
               near = fit.source.near + fit.reference.near;
  return conflict + near > 0 ? conflict / (conflict + near) : 1;
}

double margin(const std::vector<Candidate>& poses) {
  if (poses.empty() || !(poses[0].fit.score > 0)) return 0;
  return poses.size() > 1 ? 1 - poses[1].fit.score / poses[0].fit.score : 1;
}

std::vector<double> beliefs(const std::vector<Candidate>& poses, const std::vector<double>& slacks) {
  std::vector<double> result(poses.size(), 0);
  if (poses.empty()) return result;
  const auto firmness = [&](std::size_t i) {
    return i < slacks.size() ? std::clamp((1 - slacks[i]) / (1 - firm), 0.0, 1.0) : 1;
  };
  const double clear = by_margin(poses);
  result[0] = clear * by_fit(poses[0].fit) * firmness(0);
  double scores = 0;
  for (const Candidate& c : poses) scores += c.fit.score;
  for (std::size_t i = 1; i < poses.size() && scores > 0; ++i)
    result[i] = (1 - clear) * poses[i].fit.score / scores * by_fit(poses[i].fit) * firmness(i);
  // Between equals nothing tells the first from the others.
  for (std::size_t i = 1; i < poses.size(); ++i) result[i] = std::min(result[i], result[0]);
  return result;
}

std::vector<double> shared_by_odds(const std::vector<double>& confidences,
                                   const std::function<bool(std::size_t, std::size_t)>& contradict) {
  const auto odds = [&](std::size_t i) {
    return confidences[i] / (1 - std::min(confidences[i], most_certain));
  };
  std::vector<double> shared;
  for (std::size_t i = 0; i < confidences.size(); ++i) {
    // Those that contradict it may be one answer said twice: each counts unless it agrees with one that has counted.
    double others = 0;
    std::vector<std::size_t> counted;
    for (std::size_t j = 0; j < confidences.size(); ++j) {
      if (j == i || !contradict(i, j)) continue;
      const bool again = std::any_of(counted.begin(), counted.end(), [&](std::size_t k) {
        return !contradict(j, k) && confidences[k] >= confidences[j];
      });
      if (again) continue;
      counted.push_back(j);
      others += odds(j);
    }
    shared.push_back(counted.empty() ? confidences[i] : odds(i) / (1 + odds(i) + others));
  }
  return shared;
}

}  // namespace bitr::solving
