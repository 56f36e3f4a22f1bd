// Rigid motions of three-dimensional space.
#pragma once

#include <array>
#include <bitr/cloud.hpp>

namespace bitr {

/// x ↦ R x + t. A variable named `T_target_source` maps coordinates of the source frame to the target frame.
struct Pose {
  std::array<double, 9> rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< row-major, in SO(3)
  Vec3d translation = {0, 0, 0};                                 ///< in the clouds' units

  Vec3d apply(const Vec3d& point) const;
  Vec3d rotate(const Vec3d& direction) const;
  Pose inverse() const;
  /// The homogeneous matrix, row-major, last row (0, 0, 0, 1).
  std::array<double, 16> matrix() const;
};

/// (a ∘ b)(x) = a(b(x)).
Pose operator*(const Pose& a, const Pose& b);

/// Isotropic rotation error, the angle of a.rotationᵀ · b.rotation, in degrees. Accurate near 0° and 180°.
double rotation_error_degrees(const Pose& a, const Pose& b);

/// Euclidean distance of the two translations, in their units.
double translation_error(const Pose& a, const Pose& b);

}  // namespace bitr
