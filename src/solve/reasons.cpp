#include "solve/reasons.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace bitr::solving {
namespace {

// Clouds of one thing in one unit are no farther apart in size.
constexpr double most_ratio = 50;
constexpr std::size_t fewest_points = 40;
// What a good pose has.
constexpr double good_margin = 0.15, good_overlap = 0.3, good_residual = 0.35, good_slack = 0.8,
                 good_conflict = 0.15;

std::string percent(double share) { return std::to_string(std::lround(100 * share)) + " %"; }

std::string ratio_text(double ratio) {
  char text[32];
  std::snprintf(text, sizeof text, "%.*f", ratio < 10 ? 1 : 0, ratio);
  return text;
}

}  // namespace

std::string hopeless(const Prepared& source, const Prepared& reference, std::size_t source_points,
                     std::size_t reference_points) {
  if (!(source.radius > 0) || !(reference.radius > 0))
    return std::string("all points of the ") + (source.radius > 0 ? "reference" : "source") +
           " are in one place";
  const double ratio = source.radius / reference.radius;
  const double larger = std::max(ratio, 1 / ratio);
  if (larger > most_ratio)
    return std::string("the ") + (ratio > 1 ? "source" : "reference") + " is " + ratio_text(larger) +
           " times larger than the " + (ratio > 1 ? "reference" : "source") + ": other units?";
  const std::size_t fewest = std::min(source_points, reference_points);
  if (fewest < fewest_points)
    return std::string("the ") + (source_points <= reference_points ? "source" : "reference") + " has only " +
           std::to_string(fewest) + " places at the resolution that both clouds have";
  return {};
}

std::vector<std::string> reasons(const Solution& solution) {
  const SolveEvidence& e = solution.best.evidence;
  struct Reason {
    double weight;
    std::string text;
  };
  std::vector<Reason> found;
  const double overlap = std::max(e.source_overlap, e.reference_overlap);
  if (overlap < good_overlap)
    found.push_back(
        {1 - overlap / good_overlap, "only " + percent(overlap) + " of the points meet the other cloud"});
  if (e.margin < good_margin)
    found.push_back({1 - e.margin / good_margin,
                     "another pose fits nearly as well: " + percent(1 - std::max(0.0, e.margin)) +
                         " of this one's score"});
  if (e.slack > good_slack)
    found.push_back(
        {(e.slack - good_slack) / (1 - good_slack), "the surfaces can slide or turn along each other"});
  if (e.conflict > good_conflict)
    found.push_back({std::min(1.0, e.conflict / good_conflict - 1),
                     percent(e.conflict) + " of the points hover over the other cloud's surface"});
  if (e.residual > good_residual)
    found.push_back(
        {std::min(1.0, e.residual / good_residual - 1), "the surfaces do not lie on each other exactly"});
  std::stable_sort(found.begin(), found.end(),
                   [](const Reason& a, const Reason& b) { return a.weight > b.weight; });
  std::vector<std::string> texts;
  for (Reason& reason : found) texts.push_back(std::move(reason.text));
  if (texts.empty() && solution.best.confidence < 0.5)
    texts.emplace_back("the clouds fit too little to tell");
  return texts;
}

}  // namespace bitr::solving
