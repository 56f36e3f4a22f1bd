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

struct Residual {
  double squared = 0;  ///< distance
  double turned = 0;   ///< |difference of the normals|², 0 without
};

std::vector<Residual> residuals(const Surface& from, const Surface& to, const Pose& T, bool oriented,
                                const Workers& workers) {
  std::vector<Residual> result(from.some.size());
  const bool normals = from.has_normals() && to.has_normals();
  workers.parallel_for(result.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const std::uint32_t row = from.some[i];
      const Vec3d moved = T.apply(from.points[row]);
      std::uint32_t nearest = 0;
      to.tree.knnSearch(moved.data(), 1, &nearest, &result[i].squared);
      if (!normals) continue;
      const Vec3d n = T.rotate(from.normals[row]);
      const Vec3d& other = to.normals[nearest];
      const double cosine = n[0] * other[0] + n[1] * other[1] + n[2] * other[2];
      result[i].turned = 2 * (1 - (oriented ? cosine : std::abs(cosine)));
    }
  });
  return result;
}

}  // namespace

double truncation(const Surface& source, const Surface& reference) {
  return spacings * std::max(source.thinned_spacing(as_if), reference.thinned_spacing(as_if));
}

Fit measure(const Surface& source, const Surface& reference, const Pose& T, bool oriented,
            const Workers& workers) {
  const double tau = truncation(source, reference), limit = tau * tau;
  Fit fit;
  double squares = 0, score = 0;
  const auto add = [&](const Surface& from, const Surface& to, const Pose& pose) {
    double sum = 0, near = 0;
    fit.inliers = 0;
    squares = 0;
    const std::vector<Residual> all = residuals(from, to, pose, oriented, workers);
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
  add(reference, source, T.inverse());
  add(source, reference, T);
  fit.score = score / static_cast<double>(source.points.size() + reference.points.size());
  if (fit.inliers > 0) fit.rmse = std::sqrt(squares / static_cast<double>(fit.inliers));
  return fit;
}

}  // namespace bitr::refine
