// ICP between surfaces that needs no tuning: lengths are multiples of the clouds' spacing, the share with a
// counterpart is estimated, normals count by how well they agree.
#pragma once

#include <bitr/pose.hpp>
#include <memory>
#include <optional>

#include "refine/stepper.hpp"
#include "refine/surface.hpp"

namespace bitr::refine {

struct SurfaceIcpOptions {
  std::optional<double> keep = {};  ///< share of the smaller cloud's points; empty: estimated
  bool oriented = true;             ///< see MatchRule
  int most_iterations = 100;
};

struct SurfaceIcpResult {
  Pose T;  ///< takes the centred source to the centred reference
  int iterations = 0;
  bool converged = false;
  std::size_t workspace_bytes = 0;
};

/// Two stages. First the matches that make Σ squared / share^(2λ + 1) least are kept, which is an estimate of
/// the overlap (Phillips, Liu & Tomasi, "Outlier robust ICP for minimizing fractional RMSD", 2007): it
/// catches from afar. Then every match counts by Tukey's biweight, within a few spacings. Each step minimises
///   Σ w [ ((p − q)·n)² + ε|p − q|² + λ²|n_p − n_q|² ],  n ∥ n_p + n_q
/// (the symmetric point-to-plane residual of Rusinkiewicz, "A symmetric objective function for ICP", 2019), λ
/// being the ratio of the residuals' robust deviations; Σ w |p − q|² without normals. Both surfaces have
/// normals, or they are not used.
/// Surfaces and result outlive the stepper.
std::unique_ptr<Stepper> surface_icp(const Surface& source, const Surface& reference, const Pose& start,
                                     const SurfaceIcpOptions& options, SurfaceIcpResult& result);

}  // namespace bitr::refine
