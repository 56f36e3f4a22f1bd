#include <algorithm>
#include <cmath>

#include "api/plan.hpp"

namespace bitr {
namespace {

// Below this share of the largest singular value the rotation is decided by rounding noise.
constexpr double least_rotation_gap = 1e-3;

bool finite(const Pose& pose) {
  const auto ok = [](double x) { return std::isfinite(x); };
  return std::all_of(pose.rotation.begin(), pose.rotation.end(), ok) &&
         std::all_of(pose.translation.begin(), pose.translation.end(), ok);
}

// From the centred clouds' frames to the input's: x ↦ R (x − source centroid) + t + reference centroid.
Pose uncentred(Pose T, const Vec3d& source, const Vec3d& reference) {
  const Vec3d turned = T.rotate(source);
  for (int a = 0; a < 3; ++a) T.translation[a] += reference[a] - turned[a];
  return T;
}

void judge(const RawPose& raw, Assembly& assembly) {
  Diagnostics& d = assembly.diagnostics;
  d.singular_values = raw.singular_values;
  const auto [s1, s2, s3] = raw.singular_values;
  d.rotation_gap = s1 > 0 ? (s2 + (raw.determinant > 0 ? s3 : -s3)) / s1 : 0;
  if (!finite(assembly.T_reference_source)) {
    assembly.status = Status::failed;
    d.degenerate = true;
    d.reason = "a non-finite number appeared in the network";
  } else if (d.rotation_gap < least_rotation_gap) {
    assembly.status = Status::degenerate;
    d.degenerate = true;
    d.reason = "the rotation is not determined: singular values " + std::to_string(s1) + ", " + std::to_string(s2) +
               ", " + std::to_string(s3) + (raw.determinant > 0 ? "" : " with a reflection");
  }
}

std::vector<Vec3d> key_points(const std::vector<double>& rows, const PackedBatch& batch, std::size_t cloud) {
  std::vector<Vec3d> points;
  for (std::size_t i = 0; i < batch.layout.key_points; ++i) {
    const double* row = rows.data() + 3 * (cloud * batch.layout.key_points + i);
    const Vec3d& c = batch.centroids[cloud];
    points.push_back({row[0] + c[0], row[1] + c[1], row[2] + c[2]});
  }
  return points;
}

double residual(const Pose& pose, double size) {
  double sum = 0;
  for (int i = 0; i < 9; ++i) {
    const double d = pose.rotation[i] - (i % 4 == 0 ? 1 : 0);
    sum += d * d;
  }
  for (double t : pose.translation) sum += t * t / (size * size);
  return std::sqrt(sum);
}

// What a caller's pairs become before the network: each pair, then what complete matching and the swap need.
std::vector<CloudPair> evaluated_pairs(std::span<const CloudPair> pairs, const AssembleOptions& options) {
  std::vector<CloudPair> all(pairs.begin(), pairs.end());
  if (options.complete_match)
    for (const CloudPair& pair : pairs) all.push_back({pair.source, pair.source});
  if (options.swap_residual)
    for (const CloudPair& pair : pairs) all.push_back({pair.reference, pair.source});
  return all;
}

}  // namespace

BatchShape shape_of(std::span<const CloudPair> pairs, const AssembleOptions& options) {
  BatchShape shape{0, 0};
  for (const CloudPair& pair : evaluated_pairs(pairs, options)) {
    ++shape.pairs;
    shape.points += pair.source.positions.count + pair.reference.positions.count;
  }
  return shape;
}

Result<std::vector<Assembly>> assemble(Plan& plan, std::span<const CloudPair> pairs, const AssembleOptions& options) {
  if (pairs.empty()) return std::vector<Assembly>();
  Plan::Impl& impl = plan.impl();
  // Checked alone first, so that an error names the caller's pair.
  if (auto ok = pack(impl, pairs); !ok) return tl::unexpected(ok.error());
  const std::vector<CloudPair> all = evaluated_pairs(pairs, options);
  const auto batch = pack(impl, all);
  if (!batch) return tl::unexpected(batch.error());
  impl.run(*batch);

  const std::size_t count = pairs.size(), clouds = all.size();
  const auto keys = impl.runner->tensor(impl.runner->graph().key_points);
  const auto pose = [&](std::size_t i) {
    return uncentred(impl.raw_pose(i).T_reference_source, batch->centroids[i], batch->centroids[clouds + i]);
  };
  const std::size_t swapped = options.complete_match ? 2 * count : count;
  std::vector<Assembly> assemblies(count);
  for (std::size_t i = 0; i < count; ++i) {
    Assembly& assembly = assemblies[i];
    assembly.T_reference_source = options.complete_match ? pose(i) * pose(count + i) : pose(i);
    assembly.source_key_points = key_points(keys, *batch, i);
    assembly.reference_key_points = key_points(keys, *batch, clouds + i);
    judge(impl.raw_pose(i), assembly);
    if (assembly.status == Status::failed) {
      assembly.T_reference_source.rotation.fill(std::nan(""));
      assembly.T_reference_source.translation.fill(std::nan(""));
      continue;
    }
    if (options.swap_residual)
      assembly.diagnostics.swap_residual =
          residual(pose(i) * pose(swapped + i), diagonal(pairs[i].reference.positions));
    if (options.diagnostics)
      measure_overlap(pairs[i], assembly.T_reference_source, impl.device.pool(), assembly.diagnostics);
  }
  return assemblies;
}

}  // namespace bitr
