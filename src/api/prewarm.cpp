#include <cmath>

#include "api/internal.hpp"
#include "api/plan.hpp"
#include "core/guarded.hpp"

namespace bitr {
namespace {

// A bent, uneven curve: nothing about it is degenerate.
PointCloud tiny_cloud(std::size_t points, double phase) {
  PointCloud cloud;
  for (std::size_t i = 0; i < points; ++i) {
    const double s = static_cast<double>(i) + phase;
    cloud.positions.push_back({std::sin(1.7 * s), 0.6 * std::cos(2.3 * s), 0.4 * std::sin(0.9 * s * s)});
  }
  cloud.normals.assign(points, {0, 0, 1});
  cloud.colors.assign(points, {0.5F, 0.5F, 0.5F});
  return cloud;
}

Result<void> prewarm_checked(Plan& plan) {
  const std::size_t least = least_points(plan.model().config());
  if (plan.capacity().points < 2 * least)
    return fail(ErrorCode::invalid_argument, "the plan holds " + std::to_string(plan.capacity().points) +
                                                 " points, a pair has at least " + std::to_string(2 * least));
  const PointCloud source = tiny_cloud(least, 0.1), reference = tiny_cloud(least, 0.7);
  const CloudPair pair{source, reference};
  const auto done = assemble(plan, {&pair, 1}, {.diagnostics = false});
  Internal::impl(plan).begin();
  if (!done) return tl::unexpected(done.error());
  return {};
}

}  // namespace

Result<void> prewarm(Plan& plan) {
  return guarded([&] { return prewarm_checked(plan); });
}

}  // namespace bitr
