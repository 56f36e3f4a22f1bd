// The orthogonal change of basis that splits D^a ⊗ D^b into D^|a−b| ⊕ … ⊕ D^(a+b), in the real basis of
// harmonics.hpp.
#pragma once

#include <Eigen/Core>

namespace bitr::irreps {

constexpr int max_coupled_degree = 4;

/// Q(a, b): (2a+1)(2b+1) square; rows (a-index slow, b-index fast), columns grouped by J ascending.
/// Analytic (Racah's formula). 0 ≤ a, b ≤ max_coupled_degree. Computed once, then shared.
const Eigen::MatrixXd& clebsch_gordan(int a, int b);

/// The columns of Q(a, b) that belong to D^J, |a−b| ≤ J ≤ a+b.
Eigen::MatrixXd clebsch_gordan_block(int a, int b, int J);

}  // namespace bitr::irreps
