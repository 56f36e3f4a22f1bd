#include "confidence/evidence.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "refine/matching.hpp"
#include "refine/score.hpp"

namespace bitr::confidence {

using namespace refine;

namespace {

// A point whose neighbours lie to one side by this share of their mean distance ends the surface: on a
// straight rim it is 2/π, inside 0.
constexpr double least_one_sided = 0.45;
constexpr std::size_t most_neighbors = Search::most_wanted;
constexpr double rim_reach = 2;      // in truncation lengths
constexpr double least_depth = 0.6;  // in truncation lengths
constexpr double least_below = 0.8;  // cosine to the surface's inward normal

double dot(const Vec3d& a, const Vec3d& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// Which of the asked points end the surface.
std::vector<char> rim_of(const Surface& surface, const Workers& workers) {
  std::vector<char> rim(surface.some.size());
  const auto take = [&](std::size_t i, const std::uint32_t* index, const double* squared, std::size_t found) {
    const std::uint32_t row = surface.some[i];
    Vec3d sum{};
    double distances = 0;
    for (std::size_t k = 0; k < found; ++k) {
      for (int a = 0; a < 3; ++a) sum[a] += surface.points[index[k]][a] - surface.points[row][a];
      distances += std::sqrt(squared[k]);
    }
    if (surface.has_normals()) {
      const Vec3d& n = surface.normals[row];
      const double height = dot(sum, n);
      for (int a = 0; a < 3; ++a) sum[a] -= height * n[a];
    }
    rim[i] = std::sqrt(dot(sum, sum)) > least_one_sided * distances;
  };
  find({surface.points, surface.tree, &surface, surface.some.size(), most_neighbors,
        [&](std::size_t i) { return surface.points[surface.some[i]]; }, take},
       workers);
  return rim;
}

struct Beside {
  double squared = 0;  ///< to the nearest point of the other cloud
  bool below = false;  ///< that point's surface, and deep
};

// The search, which also tells of every asked point what it lies beside.
Search also_beside(Search search, const Surface& to, bool oriented, double tau, std::vector<Beside>& beside) {
  beside.resize(search.count);
  search.take = [=, &to, &beside, first = std::move(search.take), moved = search.point](
                    std::size_t i, const std::uint32_t* index, double* squared, std::size_t found) {
    beside[i].squared = *squared;
    const double distance = std::sqrt(*squared);
    if (to.has_normals() && oriented && distance >= least_depth * tau) {
      const double height = dot(moved(i), to.normals[*index]) - dot(to.points[*index], to.normals[*index]);
      beside[i].below = height < -least_below * distance;
    }
    first(i, index, squared, found);
  };
  return search;
}

}  // namespace

Evidence evidence_of_fit(const CloudPair& pair, const Pose& T_reference_source, const Workers& workers) {
  Surface source(pair.source), reference(pair.reference);
  keep_common_normals(source, reference);
  const Pose T = centred(T_reference_source, source, reference);
  bool oriented = true;
  if (source.has_normals()) {
    std::vector<Match> matches;
    for (const Search& search : match(source, reference, T, {}, matches)) find(search, workers);
    oriented = normals_are_oriented(matches);
  }
  Measurement measurement(source, reference, T, oriented);
  const double tau = truncation(source, reference), reach = rim_reach * tau;
  std::vector<Beside> of_source, of_reference;
  for (const Search& search : measurement.searches()) {
    const bool from_source = search.from == &source;
    find(also_beside(search, from_source ? reference : source, oriented, tau,
                     from_source ? of_source : of_reference),
         workers);
  }
  const Fit fit = measurement.fit();

  double below = 0, asked = 0, rims = 0, rim_points = 0;
  const auto add = [&](const Surface& from, const std::vector<Beside>& beside) {
    const std::vector<char> rim = rim_of(from, workers);
    for (std::size_t i = 0; i < beside.size(); ++i) {
      below += beside[i].below;
      if (!rim[i]) continue;
      rims += std::max(0.0, 1 - beside[i].squared / (reach * reach));
      ++rim_points;
    }
    asked += static_cast<double>(beside.size());
  };
  if (tau > 0) {
    add(source, of_source);
    add(reference, of_reference);
  }
  Evidence evidence;
  evidence.score = fit.score;
  evidence.overlap = fit.most_overlap;
  if (rim_points > 0) evidence.rims = rims / rim_points;
  if (asked > 0) evidence.interpenetration = below / asked;
  return evidence;
}

}  // namespace bitr::confidence
