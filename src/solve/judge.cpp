#include "solve/judge.hpp"

#include <algorithm>
#include <cmath>

#include "refine/rigid_fit.hpp"

namespace bitr::solving {
namespace {

constexpr double near_reach = 1.5, conflict_from = 2, conflict_reach = 5;  // resolutions
constexpr double exact = 0.4;         // resolutions: deviation across the surface of points that fit
constexpr double inside_from = 0.75;  // resolutions: how deep a point of a solid must be to be in the other
constexpr double least_above = 0.8;   // cosine between the way to the nearest point and its normal

Look look(const Level& from, const Level& to, const Pose& T, std::size_t every) {
  Look result;
  const double v = to.resolution;
  double count = 0, squares = 0, cosines = 0, near_count = 0;
  for (std::size_t i = 0; i < from.size(); i += every) {
    ++count;
    const Vec3d moved = T.apply(from.points[i]);
    const NearestWithin nearest = nearest_within(to, moved, conflict_reach * v);
    if (!nearest.found()) continue;
    const double distance = std::sqrt(nearest.squared());
    const Eigen::Vector3d n = vector(to.normals[nearest.index()]);
    const Eigen::Vector3d gap = vector(moved) - vector(to.points[nearest.index()]);
    const double signed_cosine = vector(T.rotate(from.normals[i])).dot(n),
                 cosine = to.solid ? -signed_cosine : std::abs(signed_cosine);
    const double height = gap.dot(n);
    if (to.solid && distance > inside_from * v && height < -least_above * distance) {
      ++result.conflict;
      continue;
    }
    if (to.solid && cosine < 0) {
      // Skins that lie on each other: one body in the other's place.
      result.conflict += distance <= near_reach * v;
      continue;
    }
    if (distance <= near_reach * v) {
      ++near_count;
      const double across = height / v;
      result.fit += std::exp(-across * across / (2 * exact * exact)) * std::clamp(2 * cosine - 1, 0.0, 1.0);
      squares += across * across;
      cosines += cosine;
      if (signed_cosine > 0.7) ++result.same;
      if (signed_cosine < -0.7) ++result.opposite;
    } else if (!to.solid && distance > conflict_from * v && !to.rim[nearest.index()] &&
               std::abs(height) > least_above * distance) {
      ++result.conflict;
    }
  }
  if (count == 0) return result;
  result.near = near_count / count;
  result.fit /= count;
  result.same /= count;
  result.opposite /= count;
  result.conflict /= count;
  if (near_count > 0) {
    result.residual = std::sqrt(squares / near_count);
    result.cosine = cosines / near_count;
  }
  return result;
}

}  // namespace

Fit fit(const Level& source, const Level& reference, const Pose& T, std::size_t every) {
  Fit result{look(source, reference, T, every), look(reference, source, T.inverse(), every)};
  const auto n = static_cast<double>(source.size()), m = static_cast<double>(reference.size());
  result.score = std::min(1.0, (result.source.fit * n + result.reference.fit * m) / (2 * std::min(n, m)));
  if (source.solid) {
    const double touching = result.source.near * n + result.reference.near * m,
                 inside = result.source.conflict * n + result.reference.conflict * m;
    if (touching > 0) result.score *= std::max(0.0, 1 - inside / (touching + inside));
  }
  // Where normals tell the sides apart, a true pose shows one side everywhere: the same of surfaces seen twice, the
  // other of pieces that touch.
  if (source.given_normals && reference.given_normals && !source.solid) {
    const double same = result.source.same * n + result.reference.same * m,
                 opposite = result.source.opposite * n + result.reference.opposite * m;
    if (same + opposite > 0) result.score *= 0.5 + 0.5 * std::max(same, opposite) / (same + opposite);
  }
  result.touching = std::min(result.source.near * n, result.reference.near * m);
  return result;
}

}  // namespace bitr::solving
