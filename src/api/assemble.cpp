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
    d.reason = "the rotation is not determined: singular values " + std::to_string(s1) + ", " +
               std::to_string(s2) + ", " + std::to_string(s3) +
               (raw.determinant > 0 ? "" : " with a reflection");
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

// One forward pass over pairs, in the clouds' own frames.
struct Pass {
  PackedBatch batch;
  std::vector<RawPose> raw;
  std::vector<Pose> poses;
  std::vector<double> key_points;
};

Result<Pass> forward(Plan::Impl& plan, std::span<const CloudPair> pairs) {
  auto batch = pack(plan, pairs);
  if (!batch) return tl::unexpected(batch.error());
  Pass pass;
  pass.batch = std::move(*batch);
  plan.run(pass.batch);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    pass.raw.push_back(plan.raw_pose(i));
    pass.poses.push_back(uncentred(pass.raw[i].T_reference_source, pass.batch.centroids[i],
                                   pass.batch.centroids[pairs.size() + i]));
  }
  pass.key_points = plan.runner->tensor(plan.runner->graph().key_points);
  return pass;
}

// Another pass over pairs made from the caller's, whose clouds have been checked.
template <class Make>
Result<std::vector<Pose>> forward_poses(Plan::Impl& plan, std::span<const CloudPair> pairs, Make make) {
  std::vector<CloudPair> made;
  for (const CloudPair& pair : pairs) made.push_back(make(pair));
  auto pass = forward(plan, made);
  if (!pass) return tl::unexpected(pass.error());
  return std::move(pass->poses);
}

}  // namespace

BatchShape shape_of(std::span<const CloudPair> pairs) {
  BatchShape shape{pairs.size(), 0};
  for (const CloudPair& pair : pairs) {
    const std::size_t source = pair.source.positions.count, reference = pair.reference.positions.count;
    // Complete matching also assembles the source with itself.
    shape.points += source + std::max(source, reference);
  }
  return shape;
}

Result<std::vector<Assembly>> assemble(Plan& plan, std::span<const CloudPair> pairs,
                                       const AssembleOptions& options) {
  if (pairs.empty()) return std::vector<Assembly>();
  Plan::Impl& impl = plan.impl();
  impl.timings.clear();
  // One after the other, so that options cost time and not memory.
  const auto pass = forward(impl, pairs);
  if (!pass) return tl::unexpected(pass.error());
  Result<std::vector<Pose>> own, swapped;
  if (options.complete_match)
    own = forward_poses(impl, pairs, [](const CloudPair& pair) {
      return CloudPair{pair.source, pair.source};
    });
  if (options.swap_residual)
    swapped = forward_poses(impl, pairs, [](const CloudPair& pair) {
      return CloudPair{pair.reference, pair.source};
    });
  if (!own) return tl::unexpected(own.error());
  if (!swapped) return tl::unexpected(swapped.error());

  std::vector<Assembly> assemblies(pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    Assembly& assembly = assemblies[i];
    assembly.T_reference_source = options.complete_match ? pass->poses[i] * (*own)[i] : pass->poses[i];
    assembly.source_key_points = key_points(pass->key_points, pass->batch, i);
    assembly.reference_key_points = key_points(pass->key_points, pass->batch, pairs.size() + i);
    judge(pass->raw[i], assembly);
    if (assembly.status == Status::failed) {
      assembly.T_reference_source.rotation.fill(std::nan(""));
      assembly.T_reference_source.translation.fill(std::nan(""));
      continue;
    }
    if (options.swap_residual)
      assembly.diagnostics.swap_residual =
          residual(pass->poses[i] * (*swapped)[i], diagonal(pairs[i].reference.positions));
    if (options.diagnostics)
      measure_overlap(pairs[i], assembly.T_reference_source, impl.device.pool(), assembly.diagnostics);
  }
  return assemblies;
}

}  // namespace bitr
