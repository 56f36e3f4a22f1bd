#include "refine/icp.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/point_tree.hpp"
#include "refine/rigid_fit.hpp"

namespace bitr::refine {
namespace {

struct Match {
  double squared;
  std::uint32_t source, reference;
  bool operator<(const Match& other) const {
    return squared < other.squared || (squared == other.squared && source < other.source);
  }
};

}  // namespace

struct Icp::Index {
  std::vector<Vec3d> points;
  PointRows rows{points};
  PointTree tree{3, rows, {10}};
  std::size_t bytes;
  explicit Index(const std::vector<Vec3d>& reference)
      : points(reference), bytes(points.size() * sizeof(Vec3d) + tree.usedMemory(tree)) {}
};

Icp::Icp(const std::vector<Vec3d>& reference, const IcpOptions& options)
    : index_(std::make_unique<const Index>(reference)), options_(options) {}
Icp::~Icp() = default;

IcpResult Icp::align(const std::vector<Vec3d>& source, const Pose& start) const {
  const std::size_t fewer = std::min(source.size(), index_->points.size());
  const std::size_t kept =
      std::clamp<std::size_t>(static_cast<std::size_t>(options_.keep * static_cast<double>(fewer)),
                              std::min<std::size_t>(3, fewer), fewer);
  std::vector<Match> matches(source.size());
  IcpResult result;
  result.T_reference_source = start;
  result.workspace_bytes = index_->bytes + matches.size() * sizeof(Match);
  while (result.iterations < options_.most_iterations && !result.converged) {
    ++result.iterations;
    for (std::uint32_t i = 0; i < source.size(); ++i) {
      const Vec3d moved = result.T_reference_source.apply(source[i]);
      matches[i].source = i;
      index_->tree.knnSearch(moved.data(), 1, &matches[i].reference, &matches[i].squared);
    }
    std::nth_element(matches.begin(), matches.begin() + (kept - 1), matches.end());
    double squares = 0;
    for (std::size_t i = 0; i < kept; ++i) squares += matches[i].squared;
    result.rmse = std::sqrt(squares / static_cast<double>(kept));
    const Pose next = fit(
        kept, [](std::size_t) { return 1.0; },
        [&](std::size_t i) { return vector(source[matches[i].source]); },
        [&](std::size_t i) { return vector(index_->points[matches[i].reference]); });
    const double moved = absolute_change(next, result.T_reference_source);
    result.T_reference_source = next;
    result.converged = moved < options_.tolerance;
  }
  return result;
}

}  // namespace bitr::refine
