// How rotations act on features.
#pragma once

#include <Eigen/Core>

#include "irreps/fiber.hpp"

namespace bitr::irreps {

/// D^l(R), (2l+1) square: Y_l(R v) = D^l(R) Y_l(v). R: 3×3 on (x, y, z). 0 ≤ l ≤ 4.
Eigen::MatrixXd wigner(int l, const Eigen::Matrix3d& R);

/// D^p(R₁) ⊗ D^q(R₂), dim() square.
Eigen::MatrixXd wigner(Degree degree, const Eigen::Matrix3d& R1, const Eigen::Matrix3d& R2);

/// The block-diagonal matrix by which (R₁, R₂) acts on a row of features of this fiber, size() square.
Eigen::MatrixXd representation(const Fiber& fiber, const Eigen::Matrix3d& R1, const Eigen::Matrix3d& R2);

}  // namespace bitr::irreps
