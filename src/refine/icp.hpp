// Trimmed point-to-point ICP: the best-matching share of the source is aligned with its nearest reference
// points, again and again.
#pragma once

#include <bitr/cloud.hpp>
#include <bitr/pose.hpp>
#include <cstddef>
#include <memory>
#include <vector>

#include "refine/stepper.hpp"

namespace bitr::refine {

struct IcpOptions {
  double keep = 0.8;        ///< share of min(N, M) points; at least three are kept
  double tolerance = 1e-3;  ///< stop when the entries of R and t together change by less
  int most_iterations = 500;
};

struct IcpResult {
  Pose T_reference_source;
  int iterations = 0;
  bool converged = false;
  double rmse = 0;  ///< over the kept points at the last matching, in the clouds' units
  std::size_t workspace_bytes = 0;
};

/// A reference cloud, ready to be searched from any number of starts. Both clouds need at least three points
/// with finite coordinates; R and t change in the clouds' own frames, so these should lie near the origin.
class Icp {
 public:
  explicit Icp(const std::vector<Vec3d>& reference, const IcpOptions& options = {});
  ~Icp();
  Icp(const Icp&) = delete;
  Icp& operator=(const Icp&) = delete;

  IcpResult align(const std::vector<Vec3d>& source, const Pose& start) const;
  /// The same step by step; source and result outlive it.
  std::unique_ptr<Stepper> stepper(const std::vector<Vec3d>& source, const Pose& start,
                                   IcpResult& result) const;

 private:
  struct Index;
  class Steps;
  std::unique_ptr<const Index> index_;
  IcpOptions options_;
};

}  // namespace bitr::refine
