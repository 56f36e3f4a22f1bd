// Poses of a family smaller than all rigid motions: shifts, or turns about one axis and shifts.
#pragma once

#include <bitr/assemble.hpp>
#include <bitr/cloud.hpp>
#include <optional>
#include <string>

#include "cli.hpp"
#include "output.hpp"

namespace bitr::tool {

struct Restriction {
  bool translation = false;   ///< no turn at all
  std::optional<Vec3d> axis;  ///< a unit vector: turns about this axis of the frames only

  bool any() const { return translation || axis; }
};

/// --translation-only, --yaw-only [AXIS]
void add_restriction_options(CLI::App& app, Restriction& restriction);

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

/// The same of an assembly's pose: where the turn is not determined the assembly is degenerate. Nothing else
/// of its diagnostics changes.
Restricted restrict_assembly(const Restriction& restriction, const Vec3d& source_centroid,
                             Assembly& assembly);

/// "a shift", "a turn of 12.5° about (0, 0, 1) and a shift".
std::string describe(const Restricted& restricted);
/// The family alone, for settings.
Json to_json(const Restriction& restriction);
Json to_json(const Restricted& restricted);

}  // namespace bitr::tool
