#include "refine/matching.hpp"

#include <cmath>

#include "refine/rigid_fit.hpp"

namespace bitr::refine {
namespace {

// Nearest points among which the normals choose.
constexpr std::size_t candidates = 16;
constexpr std::size_t grain = 256;

struct Seen {
  Eigen::Vector3d point = Eigen::Vector3d::Zero(), normal = Eigen::Vector3d::Zero();
};

// What `from`, moved by T, finds on `to`: found(i, moved, counterpart, squared).
template <class Found>
void look(const Surface& from, const Surface& to, const Pose& T, const MatchRule& rule,
          const Workers& workers, const Found& found) {
  const bool normals = from.has_normals();
  const std::size_t wanted = normals && rule.normal_length > 0 ? candidates : 1;
  const double factor = 2 * rule.normal_length * rule.normal_length;
  workers.parallel_for(from.some.size(), grain, [&](std::size_t begin, std::size_t end) {
    std::uint32_t index[candidates];
    double squared[candidates];
    for (std::size_t i = begin; i < end; ++i) {
      const std::uint32_t row = from.some[i];
      const Vec3d moved = T.apply(from.points[row]);
      Seen here{vector(moved), {}};
      if (normals) here.normal = vector(T.rotate(from.normals[row]));
      const std::size_t count = to.tree.knnSearch(moved.data(), wanted, index, squared);
      std::size_t best = 0;
      for (std::size_t k = 0; normals && k < count; ++k) {
        const double cosine = here.normal.dot(vector(to.normals[index[k]]));
        // |n − n'|² = 2 (1 − n·n')
        squared[k] += factor * (1 - (rule.oriented ? cosine : std::abs(cosine)));
        if (squared[k] < squared[best]) best = k;
      }
      Seen there{vector(to.points[index[best]]), Eigen::Vector3d::Zero()};
      if (normals) there.normal = vector(to.normals[index[best]]);
      if (!rule.oriented && here.normal.dot(there.normal) < 0) there.normal = -there.normal;
      found(i, here, there, squared[best]);
    }
  });
}

}  // namespace

void match(const Surface& source, const Surface& reference, const Pose& T, const MatchRule& rule,
           const Workers& workers, std::vector<Match>& matches) {
  const std::size_t first = source.some.size();
  matches.resize(first + reference.some.size());
  look(source, reference, T, rule, workers,
       [&](std::size_t i, const Seen& here, const Seen& there, double squared) {
         matches[i] = {here.point,   there.point, here.normal,
                       there.normal, squared,     static_cast<std::uint32_t>(i)};
       });
  const Eigen::Matrix3d R = rotation_of(T);
  const Eigen::Vector3d t = vector(T.translation);
  look(reference, source, T.inverse(), rule, workers,
       [&](std::size_t i, const Seen& here, const Seen& there, double squared) {
         matches[first + i] = {R * there.point + t,
                               R * here.point + t,
                               R * there.normal,
                               R * here.normal,
                               squared,
                               static_cast<std::uint32_t>(first + i)};
       });
}

bool normals_are_oriented(const Surface& source, const Surface& reference, const Pose& T,
                          const Workers& workers) {
  if (!source.has_normals() || !reference.has_normals()) return true;
  std::vector<Match> matches;
  match(source, reference, T, {}, workers, matches);
  std::size_t opposite = 0, parallel = 0;
  for (const Match& m : matches) {
    const double cosine = m.source_normal.dot(m.reference_normal);
    parallel += std::abs(cosine) > 0.7;
    opposite += cosine < -0.7;
  }
  return 5 * opposite <= 2 * parallel;
}

}  // namespace bitr::refine
