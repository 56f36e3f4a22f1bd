#include "refine/matching.hpp"

#include <cmath>

#include "refine/rigid_fit.hpp"

namespace bitr::refine {
namespace {

struct Seen {
  Eigen::Vector3d point = Eigen::Vector3d::Zero(), normal = Eigen::Vector3d::Zero();
};

// What `from`, moved by T, finds on `to`: found(i, moved, counterpart, squared).
template <class Found>
Search look(const Surface& from, const Surface& to, const Pose& T, const MatchRule& rule,
            const Found& found) {
  const bool normals = from.has_normals();
  const double factor = 2 * rule.normal_length * rule.normal_length;
  const auto take = [=, &from, &to, oriented = rule.oriented](std::size_t i, const std::uint32_t* index,
                                                              double* squared, std::size_t count) {
    const std::uint32_t row = from.some[i];
    Seen here{vector(T.apply(from.points[row])), {}};
    if (normals) here.normal = vector(T.rotate(from.normals[row]));
    std::size_t best = 0;
    for (std::size_t k = 0; normals && k < count; ++k) {
      const double cosine = here.normal.dot(vector(to.normals[index[k]]));
      // |n − n'|² = 2 (1 − n·n')
      squared[k] += factor * (1 - (oriented ? cosine : std::abs(cosine)));
      if (squared[k] < squared[best]) best = k;
    }
    Seen there{vector(to.points[index[best]]), Eigen::Vector3d::Zero()};
    if (normals) there.normal = vector(to.normals[index[best]]);
    if (!oriented && here.normal.dot(there.normal) < 0) there.normal = -there.normal;
    found(i, here, there, squared[best]);
  };
  // Among several the normals choose.
  return {.in = to.points,
          .tree = to.tree,
          .from = &from,
          .count = from.some.size(),
          .wanted = normals && rule.normal_length > 0 ? Search::most_wanted : 1,
          .point = [T, &from](std::size_t i) { return T.apply(from.points[from.some[i]]); },
          .take = take};
}

}  // namespace

std::vector<Search> match(const Surface& source, const Surface& reference, const Pose& T,
                          const MatchRule& rule, std::vector<Match>& matches) {
  const std::size_t first = source.some.size();
  matches.resize(first + reference.some.size());
  const Eigen::Matrix3d R = rotation_of(T);
  const Eigen::Vector3d t = vector(T.translation);
  return {look(source, reference, T, rule,
               [&matches](std::size_t i, const Seen& here, const Seen& there, double squared) {
                 matches[i] = {here.point,   there.point, here.normal,
                               there.normal, squared,     static_cast<std::uint32_t>(i)};
               }),
          look(reference, source, T.inverse(), rule,
               [&matches, R, t, first](std::size_t i, const Seen& here, const Seen& there, double squared) {
                 matches[first + i] = {R * there.point + t,
                                       R * here.point + t,
                                       R * there.normal,
                                       R * here.normal,
                                       squared,
                                       static_cast<std::uint32_t>(first + i)};
               })};
}

bool normals_are_oriented(const std::vector<Match>& matches) {
  std::size_t opposite = 0, parallel = 0;
  for (const Match& m : matches) {
    const double cosine = m.source_normal.dot(m.reference_normal);
    parallel += std::abs(cosine) > 0.7;
    opposite += cosine < -0.7;
  }
  return 5 * opposite <= 2 * parallel;
}

}  // namespace bitr::refine
