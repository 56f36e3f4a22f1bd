// What the network accepts: every number of a batch is looked at before anything is computed.
#include <algorithm>
#include <cmath>
#include <limits>

#include "api/pack.hpp"
#include "core/morton.hpp"

namespace bitr {
namespace {

// Extents whose squares, and the squares' sums, stay far inside the arithmetic's range.
struct Range {
  double least, most;
};
constexpr Range range_f32{1e-15, 1e15}, range_f64{1e-120, 1e120};

std::string cloud_label(std::size_t cloud, std::size_t pairs) {
  const std::string side = cloud < pairs ? "source" : "reference";
  return pairs == 1 ? side + " cloud" : side + " cloud of pair " + std::to_string(cloud % pairs);
}

std::string shortest(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

Result<void> check_view(const Vec3View& rows, const std::string& label, const char* what) {
  const std::size_t least = 3 * (rows.scalar == Scalar::f64 ? sizeof(double) : sizeof(float));
  if (rows.count > 0 && (rows.data == nullptr || rows.stride < least))
    return fail(ErrorCode::invalid_argument, label + ": " + what + " have no data or a stride of " +
                                                 std::to_string(rows.stride) + " bytes, must be at least " +
                                                 std::to_string(least));
  return {};
}

using Order = std::vector<std::uint32_t>;

// Finite numbers and a representable extent.
Result<void> check_positions(const Vec3View& points, const std::string& label, const Range& range) {
  Vec3d sum{}, low, high;
  low.fill(std::numeric_limits<double>::infinity());
  high.fill(-std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < points.count; ++i) {
    const Vec3d p = points[i];
    for (int a = 0; a < 3; ++a) {
      if (!std::isfinite(p[a]))
        return fail(ErrorCode::invalid_argument, label + ": point " + std::to_string(i) + " is not finite");
      sum[a] += p[a];
      low[a] = std::min(low[a], p[a]);
      high[a] = std::max(high[a], p[a]);
    }
  }
  if (low == high)
    return fail(ErrorCode::invalid_argument,
                label + ": all " + std::to_string(points.count) + " points are equal");
  const double extent = std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
  const double farthest = std::max({std::abs(sum[0]), std::abs(sum[1]), std::abs(sum[2])});
  if (!(extent >= range.least && extent <= range.most) || !std::isfinite(farthest))
    return fail(ErrorCode::invalid_argument, label + ": its extent of " + shortest(extent) + " is outside " +
                                                 shortest(range.least) + " … " + shortest(range.most) +
                                                 ", what the plan's precision holds");
  return {};
}

Vec3d mean(const Vec3View& points, const Order& order) {
  Vec3d sum{};
  for (const std::uint32_t i : order)
    for (int a = 0; a < 3; ++a) sum[a] += points[i][a];
  for (double& s : sum) s /= static_cast<double>(points.count);
  return sum;
}

Result<void> check_attribute(const Vec3View& rows, std::size_t points, const std::string& label,
                             const char* what) {
  if (rows.count != points)
    return fail(ErrorCode::invalid_argument, label + ": the model reads " + what + "; the cloud has " +
                                                 std::to_string(rows.count) + " for " +
                                                 std::to_string(points) + " points");
  if (auto ok = check_view(rows, label, what); !ok) return ok;
  for (std::size_t i = 0; i < rows.count; ++i)
    for (double x : rows[i])
      if (!std::isfinite(x))
        return fail(ErrorCode::invalid_argument,
                    label + ": one of the " + what + ", " + std::to_string(i) + ", is not finite");
  return {};
}

// From the centroid, over their root mean square.
std::vector<Vec3d> offsets(const Vec3View& points, const Order& order, const Vec3d& centroid) {
  std::vector<Vec3d> all(points.count);
  double square = 0;
  for (const std::uint32_t i : order)
    for (int a = 0; a < 3; ++a) {
      all[i][a] = points[i][a] - centroid[a];
      square += all[i][a] * all[i][a];
    }
  const double scale = std::sqrt(static_cast<double>(points.count) / square);
  for (Vec3d& offset : all)
    for (double& x : offset) x *= scale;
  return all;
}

}  // namespace

std::size_t least_points(const ModelConfig& config) {
  return static_cast<std::size_t>(
      std::max(config.k_neighbor * config.neighbor_dilation + 1, config.key_mean_num));
}

Result<PackedBatch> pack(const ModelConfig& config, Precision precision, const BatchShape& capacity,
                         std::span<const CloudPair> pairs) {
  const Range& range = precision == Precision::f32 ? range_f32 : range_f64;
  PackedBatch batch;
  std::vector<std::uint32_t> sizes;
  std::size_t total = 0;
  for (const CloudPair& pair : pairs) batch.clouds.push_back(&pair.source);
  for (const CloudPair& pair : pairs) batch.clouds.push_back(&pair.reference);
  const std::size_t least = least_points(config);
  for (std::size_t c = 0; c < batch.clouds.size(); ++c) {
    const CloudView& cloud = *batch.clouds[c];
    const std::string label = cloud_label(c, pairs.size());
    if (cloud.positions.count < least)
      return fail(ErrorCode::invalid_argument, label + ": " + std::to_string(cloud.positions.count) +
                                                   " points, the model needs at least " +
                                                   std::to_string(least));
    total += cloud.positions.count;
    if (total > capacity.points || pairs.size() > capacity.pairs)
      return fail(ErrorCode::invalid_argument,
                  "the batch has " + std::to_string(pairs.size()) + " pairs and at least " +
                      std::to_string(total) + " points, the plan holds " + std::to_string(capacity.pairs) +
                      " and " + std::to_string(capacity.points));
    if (auto ok = check_view(cloud.positions, label, "positions"); !ok) return tl::unexpected(ok.error());
    if (auto ok = check_positions(cloud.positions, label, range); !ok) return tl::unexpected(ok.error());
    if (config.return_normals)
      if (auto ok = check_attribute(cloud.normals, cloud.positions.count, label, "normals"); !ok)
        return tl::unexpected(ok.error());
    if (config.get_color)
      if (auto ok = check_attribute(cloud.colors, cloud.positions.count, label, "colours"); !ok)
        return tl::unexpected(ok.error());
    const Order& order = batch.order.emplace_back(
        morton_order(cloud.positions.count, [&](std::size_t i) { return cloud.positions[i]; }));
    const Vec3d& centroid = batch.centroids.emplace_back(mean(cloud.positions, order));
    if (config.centroid_offset) batch.offsets.push_back(offsets(cloud.positions, order, centroid));
    sizes.push_back(static_cast<std::uint32_t>(cloud.positions.count));
  }
  batch.layout = graph::BatchLayout(sizes, static_cast<std::uint32_t>(config.num_key_points));
  return batch;
}

std::optional<InputRows> input_rows(const PackedBatch& batch, std::size_t cloud, graph::Input role) {
  switch (role) {
    case graph::Input::positions:
      return InputRows{batch.clouds[cloud]->positions, batch.centroids[cloud]};
    case graph::Input::normals:
      return InputRows{batch.clouds[cloud]->normals};
    case graph::Input::colors:
      return InputRows{batch.clouds[cloud]->colors};
    case graph::Input::offsets:
      return InputRows{Vec3View(batch.offsets[cloud])};
    case graph::Input::truth:
      break;
  }
  return std::nullopt;
}

}  // namespace bitr
