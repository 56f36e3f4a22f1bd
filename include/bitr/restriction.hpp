// Poses of a family smaller than all rigid motions: shifts, or turns about one axis and shifts.
#pragma once

#include <bitr/cloud.hpp>
#include <bitr/pose.hpp>
#include <optional>
#include <string>

namespace bitr {

struct Restriction {
  bool translation = false;   ///< no turn at all
  std::optional<Vec3d> axis;  ///< a unit vector: turns about this axis of the frames only

  bool any() const { return translation || axis; }
};

/// A pose of the family. The turn about the axis n that is nearest to a rotation R in the Frobenius norm is
/// by θ = atan2(b, a) with a = tr R − nᵀRn, b = n · (R − Rᵀ)^∨.
struct Restricted {
  Restriction restriction;
  Pose pose;
  double turn_degrees = 0;       ///< about the axis
  std::optional<double> margin;  ///< √(a² + b²) in 0 … 2; where it is 0 every turn is as near as any other

  /// Why the turn is not determined, which it is not below a margin of 1e-3; else empty.
  std::string problem() const;
};

/// Its rotation is the nearest to the pose's, and the source's centroid goes where the pose takes it.
Restricted restricted(const Restriction& restriction, const Pose& pose, const Vec3d& source_centroid);
/// Takes up what became of the pose within its family: the margin stays that of what was restricted.
void follow(const Pose& pose, const Vec3d& source_centroid, Restricted& restricted);

/// "a shift", "a turn of 12.5° about (0, 0, 1) and a shift".
std::string describe(const Restricted& restricted);

}  // namespace bitr
