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
  double usual = 0;  ///< the value that right poses usually have
};

struct Calibration {
  double bias = 0;
  Term rotation_spread = {}, turn = {};  ///< log(1 + degrees)
  Term translation_spread = {};          ///< log(1 + percent)
  Term gap = {}, score = {}, overlap = {}, rims = {};
};

// 3330 poses, 2473 of them right
constexpr Calibration of_network = {
    .bias = -0.0421,
    .rotation_spread = {-0.956, 1.77},
    .translation_spread = {-0.491, 2.01},
    .gap = {2.66, 1.73},
    .score = {3.79, 0.0906},
    .overlap = {-2.54, 0.173},
    .rims = {1.25, 0.357},
};
// 870 poses, 629 of them right
constexpr Calibration of_refined = {
    .bias = 1.95,
    .rotation_spread = {-0.601, 1.81},
    .turn = {-1.01, 2.28},
    .translation_spread = {-0.221, 1.8},
    .gap = {0.823, 1.66},
    .score = {9.89, 0.363},
    .overlap = {-4.26, 0.521},
    .rims = {2.12, 0.688},
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

Confidence confidence_in(const Evidence& evidence) {
  const Calibration& c = !evidence.rotation_spread ? of_fit : evidence.refined_by ? of_refined : of_network;
  double log_odds = c.bias;
  std::vector<std::pair<double, std::string>> effects;
  const auto add = [&](const Term& term, double value) {
    log_odds += term.weight * value;
    return term.weight * (value - term.usual);
  };
  if (evidence.rotation_spread)
    effects.emplace_back(add(c.rotation_spread, std::log1p(*evidence.rotation_spread)),
                         text("answers on parts of the clouds differ by %.0f°", *evidence.rotation_spread));
  if (evidence.translation_spread)
    effects.emplace_back(
        add(c.translation_spread, std::log1p(100 * *evidence.translation_spread)),
        text("answers on parts of the clouds place them differently: by %.0f %% of their radius",
             100 * *evidence.translation_spread));
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
