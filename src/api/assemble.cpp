#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "api/internal.hpp"
#include "api/plan.hpp"
#include "core/finite.hpp"
#include "core/guarded.hpp"

namespace bitr {
namespace {

// From the centred clouds' frames to the input's: x ↦ R (x − source centroid) + t + reference centroid.
Pose uncentred(Pose T, const Vec3d& source, const Vec3d& reference) {
  const Vec3d turned = T.rotate(source);
  for (int a = 0; a < 3; ++a) T.translation[a] += reference[a] - turned[a];
  return T;
}

double rotation_gap(const RawPose& raw) {
  const auto [s1, s2, s3] = raw.singular_values;
  return s1 > 0 ? (s2 + (raw.determinant > 0 ? s3 : -s3)) / s1 : 0;
}

void diagnose(const RawPose& raw, Assembly& assembly) {
  Diagnostics& d = assembly.diagnostics;
  d.singular_values = raw.singular_values;
  const auto [s1, s2, s3] = raw.singular_values;
  d.rotation_gap = rotation_gap(raw);
  if (!is_finite(assembly.T_reference_source)) {
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

// The rotation comes rounded to the plan's precision: a Newton step towards its polar factor makes it
// orthonormal to the square of that error, so that far-away centroids turn exactly.
std::array<double, 9> orthonormalised(const double* rows) {
  using Matrix3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  const Matrix3 R = Eigen::Map<const Matrix3>(rows);
  const Matrix3 refined = 0.5 * R * (3 * Matrix3::Identity() - R.transpose() * R);
  std::array<double, 9> result;
  Eigen::Map<Matrix3>(result.data()) = refined;
  return result;
}

// One forward pass over pairs, relative to the clouds' centroids.
struct Pass {
  PackedBatch batch;
  std::vector<RawPose> raw;
  std::vector<double> key_points;
};

Result<Pass> forward(Plan::Impl& plan, std::span<const CloudPair> pairs) {
  auto batch = pack(plan.model.config(), plan.options.precision, plan.capacity, pairs);
  if (!batch) return tl::unexpected(batch.error());
  Pass pass{std::move(*batch), {}, {}};
  plan.run(pass.batch);
  const auto rows = plan.executor->read<double>(graph::Output::pose);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const double* row = rows.data() + i * ops::pose_width;
    pass.raw.push_back(
        {{orthonormalised(row), {row[9], row[10], row[11]}}, {row[12], row[13], row[14]}, row[15]});
  }
  pass.key_points = plan.executor->read<double>(graph::Output::key_points);
  return pass;
}

// Another pass over pairs made from the caller's.
template <class Make>
Result<Pass> forward_made(Plan::Impl& plan, std::span<const CloudPair> pairs, Make make) {
  std::vector<CloudPair> made;
  for (const CloudPair& pair : pairs) made.push_back(make(pair));
  return forward(plan, made);
}

Result<std::vector<Assembly>> assemble_checked(Plan::Impl& impl, std::span<const CloudPair> pairs,
                                               const AssembleOptions& options) {
  impl.begin();
  if (pairs.empty()) return std::vector<Assembly>();
  // One after the other, so that options cost time and not memory.
  const auto pass = forward(impl, pairs);
  if (!pass) return tl::unexpected(pass.error());
  Result<Pass> own, swapped;
  if (options.complete_match)
    own = forward_made(impl, pairs, [](const CloudPair& pair) {
      return CloudPair{pair.source, pair.source};
    });
  if (options.swap_residual)
    swapped = forward_made(impl, pairs, [](const CloudPair& pair) {
      return CloudPair{pair.reference, pair.source};
    });
  if (!own) return tl::unexpected(own.error());
  if (!swapped) return tl::unexpected(swapped.error());

  std::vector<Assembly> assemblies(pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    Assembly& assembly = assemblies[i];
    const RawPose *found = &pass->raw[i], *doubtful = found;
    Pose pose = found->T_reference_source;
    if (options.complete_match) {
      // Both passes read the source from the same centroid, so their poses compose as they are.
      const RawPose& self = own->raw[i];
      pose = pose * self.T_reference_source;
      if (rotation_gap(self) < rotation_gap(*found)) doubtful = &self;
    }
    assembly.T_reference_source =
        uncentred(pose, pass->batch.centroids[i], pass->batch.centroids[pairs.size() + i]);
    assembly.source_key_points = key_points(pass->key_points, pass->batch, i);
    assembly.reference_key_points = key_points(pass->key_points, pass->batch, pairs.size() + i);
    diagnose(*doubtful, assembly);
    if (assembly.status == Status::failed) {
      assembly.T_reference_source.rotation.fill(std::nan(""));
      assembly.T_reference_source.translation.fill(std::nan(""));
      continue;
    }
    if (options.swap_residual)
      assembly.diagnostics.swap_residual =
          residual(found->T_reference_source * swapped->raw[i].T_reference_source,
                   diagonal(pairs[i].reference.positions));
    if (options.diagnostics)
      measure_overlap(pairs[i], assembly.T_reference_source, Internal::pool(impl.device),
                      assembly.diagnostics);
  }
  return assemblies;
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
  return guarded([&] { return assemble_checked(Internal::impl(plan), pairs, options); });
}

}  // namespace bitr
