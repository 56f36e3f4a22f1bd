#include <algorithm>
#include <bitr/confidence.hpp>
#include <bitr/io.hpp>
#include <cmath>
#include <tuple>

#include "api/internal.hpp"
#include "api/plan.hpp"
#include "confidence/ensemble.hpp"
#include "core/centroid.hpp"
#include "core/failure.hpp"
#include "core/guarded.hpp"
#include "core/select_rows.hpp"

namespace bitr {
namespace {

constexpr double most_of_cloud = 0.95;

void check(const ResampleOptions& options) {
  if (options.answers < 2 || options.answers > 100 || options.answers % 2 != 0)
    refuse("answers " + std::to_string(options.answers) + " is not an even number in 2 … 100");
  if (!(options.share > 0 && options.share < 1))
    refuse("share " + std::to_string(options.share) + " is not above 0 and below 1");
}

// Points of a part; empty where the model needs almost the whole.
std::optional<std::size_t> part_size(const CloudView& cloud, const Model& model,
                                     const ResampleOptions& options) {
  const auto share_of = [&](double share) {
    return static_cast<std::size_t>(share * static_cast<double>(cloud.positions.count));
  };
  const PointRange trained = model.trained_points().value_or(PointRange{0, most_resampled});
  const std::size_t most = share_of(std::max(options.share, most_of_cloud));
  const std::size_t size = std::min(
      most, std::max(trained.low, std::min({share_of(options.share), trained.high, most_resampled})));
  if (size < least_points(model.config())) return {};
  return size;
}

// From the centroid outwards: parts are then the same in every frame and whatever the order of the points.
PointCloud ordered(const CloudView& cloud) {
  const Vec3d centroid = centroid_of(cloud.positions);
  std::vector<std::pair<double, std::size_t>> order;
  for (std::size_t i = 0; i < cloud.positions.count; ++i) {
    const Vec3d point = cloud.positions[i];
    order.emplace_back(std::hypot(point[0] - centroid[0], point[1] - centroid[1], point[2] - centroid[2]), i);
  }
  std::sort(order.begin(), order.end());
  std::vector<std::size_t> rows;
  for (const auto& [distance, row] : order) rows.push_back(row);
  return select_rows(cloud, rows);
}

struct Parted {
  std::size_t pair = 0;
  PointCloud source, reference;
  std::size_t source_points = 0, reference_points = 0;  ///< in each of its parts
  confidence::Ensemble ensemble;
};

}  // namespace

Result<std::vector<std::optional<NetworkEvidence>>> resample(Plan& plan, std::span<const CloudPair> pairs,
                                                             std::span<const Assembly> assemblies,
                                                             const ResampleOptions& options) {
  using Found = std::vector<std::optional<NetworkEvidence>>;
  return guarded([&]() -> Result<Found> {
    check(options);
    if (pairs.size() != assemblies.size())
      refuse(std::to_string(assemblies.size()) + " assemblies for " + std::to_string(pairs.size()) +
             " pairs");
    // What the plan tells of its last assemble() is the caller's.
    Plan::Impl& impl = Internal::impl(plan);
    auto told = std::tie(impl.timings, impl.profile, impl.passes, impl.began);
    const std::tuple before = {impl.timings, impl.profile, impl.passes, impl.began};
    std::vector<Parted> parted;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const auto source = part_size(pairs[i].source, plan.model(), options),
                 reference = part_size(pairs[i].reference, plan.model(), options);
      if (assemblies[i].status == Status::failed || !source || !reference) continue;
      parted.push_back({i, ordered(pairs[i].source), ordered(pairs[i].reference), *source, *reference,
                        confidence::Ensemble(pairs[i])});
      parted.back().ensemble.add(assemblies[i]);
    }
    for (int member = 0; member < options.answers; ++member) {
      // By two seeds: points that are in both clouds must not stay partners. The next member exchanges them,
      // or swapped clouds would not be asked the same.
      const std::uint64_t first = options.seed + static_cast<std::uint64_t>(member),
                          second = member % 2 == 0 ? first + 1 : first - 1;
      std::vector<PointCloud> parts;
      for (const Parted& of : parted) {
        parts.push_back(io::subsample(of.source, of.source_points, first));
        parts.push_back(io::subsample(of.reference, of.reference_points, second));
      }
      std::vector<CloudPair> part_pairs;
      for (std::size_t i = 0; i < parted.size(); ++i) part_pairs.push_back({parts[2 * i], parts[2 * i + 1]});
      const auto members = value_or_throw(assemble(plan, part_pairs, {.diagnostics = false}));
      for (std::size_t i = 0; i < parted.size(); ++i) parted[i].ensemble.add(members[i]);
    }
    Found found(pairs.size());
    for (const Parted& of : parted) found[of.pair] = of.ensemble.together();
    told = before;
    return found;
  });
}

}  // namespace bitr
