#include "refine/score.hpp"

#include <algorithm>
#include <cmath>

namespace bitr::refine {
namespace {

constexpr double spacings = 3;
// Denser clouds are looked at as if they had so many points: how far off a pose may be, and the noise, do not
// shrink with the spacing.
constexpr std::size_t as_if = 512;
constexpr double most_turned = 1;  // 60°

}  // namespace

double truncation(const Surface& source, const Surface& reference) {
  return spacings * std::max(source.thinned_spacing(as_if), reference.thinned_spacing(as_if));
}

Search Measurement::look(const Surface& from, const Surface& to, const Pose& T,
                         std::vector<Residual>& residuals) const {
  residuals.resize(from.some.size());
  const bool normals = from.has_normals() && to.has_normals();
  const auto take = [=, &from, &to, &residuals, oriented = oriented_](
                        std::size_t i, const std::uint32_t* nearest, const double* squared, std::size_t) {
    residuals[i] = {*squared, 0};
    if (!normals) return;
    const Vec3d n = T.rotate(from.normals[from.some[i]]);
    const Vec3d& other = to.normals[*nearest];
    const double cosine = n[0] * other[0] + n[1] * other[1] + n[2] * other[2];
    residuals[i].turned = std::max(0.0, 2 * (1 - (oriented ? cosine : std::abs(cosine))));
  };
  return {.in = to.points,
          .tree = to.tree,
          .from = &from,
          .count = from.some.size(),
          .point = [T, &from](std::size_t i) { return T.apply(from.points[from.some[i]]); },
          .take = take};
}

std::vector<Search> Measurement::searches() {
  return {look(reference_, source_, T_.inverse(), of_reference_), look(source_, reference_, T_, of_source_)};
}

Fit Measurement::fit() const {
  const double tau = truncation(source_, reference_), limit = tau * tau;
  Fit fit;
  double squares = 0, score = 0;
  const auto add = [&](const Surface& from, const std::vector<Residual>& all) {
    double sum = 0, near = 0;
    fit.inliers = 0;
    squares = 0;
    for (const Residual& residual : all) {
      if (residual.turned > most_turned) continue;
      near += residual.squared < 4 * limit;
      if (residual.squared >= limit) continue;
      sum += std::max(0.0, 1 - residual.squared / limit - residual.turned / most_turned);
      squares += residual.squared;
      ++fit.inliers;
    }
    // A cloud counts by the points it has, not by how many of them are asked.
    const auto asked = static_cast<double>(all.size());
    score += sum / asked * static_cast<double>(from.points.size());
    fit.overlap = static_cast<double>(fit.inliers) / asked;
    fit.most_overlap = std::max(fit.most_overlap, fit.overlap);
    fit.most_near = std::max(fit.most_near, near / asked);
  };
  add(reference_, of_reference_);
  add(source_, of_source_);
  fit.score = score / static_cast<double>(source_.points.size() + reference_.points.size());
  if (fit.inliers > 0) fit.rmse = std::sqrt(squares / static_cast<double>(fit.inliers));
  return fit;
}

}  // namespace bitr::refine
