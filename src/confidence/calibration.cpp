#include "confidence/calibration.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

namespace bitr::confidence {
namespace {

// Logistic regressions on generated pairs of the validation split: how they were made, and how well they tell
// right from wrong on the test split, is in docs/confidence.md; bench/calibrate.py fits them.
struct Term {
  double weight = 0;
  double usual = 0;  ///< of right poses
};

struct Calibration {
  double bias = 0;
  Term spread = {}, gap = {};  ///< spread and turn as log(1 + degrees)
  Term score = {}, overlap = {}, rims = {};
  Term turn = {};
};

// 3300 poses, 2226 of them right
constexpr Calibration of_network = {
    .bias = 0.348,
    .spread = {-1.09, 2.38},
    .gap = {2.19, 1.73},
    .score = {4.29, 0.0897},
    .overlap = {-1.68, 0.174},
    .rims = {0.417, 0.344},
};
// 900 poses, 653 of them right
constexpr Calibration of_refined = {
    .bias = 3.8,
    .spread = {-0.56, 2.45},
    .gap = {0.549, 1.64},
    .score = {9.42, 0.359},
    .overlap = {-4.92, 0.516},
    .rims = {1.13, 0.68},
    .turn = {-1.09, 2.43},
};
// 2200 poses, 915 of them right
constexpr Calibration of_fit = {
    .bias = -10.9,
    .score = {7.08, 0.891},
    .overlap = {2.57, 0.975},
    .rims = {3.94, 0.948},
};

// What lowers the odds by less than this, compared with right poses, is not worth a word.
constexpr double least_effect = 0.5;

template <class... Values>
std::string text(const char* format, Values... values) {
  char line[160];
  std::snprintf(line, sizeof line, format, values...);
  return line;
}

}  // namespace

Confidence judged(const Evidence& evidence) {
  const Calibration& c = !evidence.spread ? of_fit : evidence.refined_by ? of_refined : of_network;
  double log_odds = c.bias;
  std::vector<std::pair<double, std::string>> effects;
  const auto add = [&](const Term& term, double value) {
    log_odds += term.weight * value;
    return term.weight * (value - term.usual);
  };
  if (evidence.spread)
    effects.emplace_back(add(c.spread, std::log1p(*evidence.spread)),
                         text("answers on parts of the clouds differ by %.0f°", *evidence.spread));
  if (evidence.rotation_gap)
    effects.emplace_back(add(c.gap, *evidence.rotation_gap),
                         text("the network's rotation is vague: gap %.2f in 0 … 2", *evidence.rotation_gap));
  if (evidence.refined_by)
    effects.emplace_back(add(c.turn, std::log1p(*evidence.refined_by)),
                         text("refinement turned the network's answer by %.0f°", *evidence.refined_by));
  // These speak together: a good fit of a small overlap is worth as much as one of a large overlap.
  const double fit = add(c.score, evidence.score) + add(c.overlap, evidence.overlap) +
                     add(c.rims, evidence.rims.value_or(c.rims.usual));
  effects.emplace_back(fit, text("the clouds fit badly: score %.2f with %.0f %% overlap", evidence.score,
                                 100 * evidence.overlap) +
                                (evidence.rims ? text(", rims %.2f", *evidence.rims) : ""));
  std::stable_sort(effects.begin(), effects.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  Confidence confidence{.value = 1 / (1 + std::exp(-log_odds)), .reasons = {}, .evidence = evidence};
  for (auto& [effect, reason] : effects)
    if (effect < -least_effect) confidence.reasons.push_back(std::move(reason));
  return confidence;
}

}  // namespace bitr::confidence
