// Clebsch–Gordan products of features on both sides at once, term by term.
#pragma once

#include <vector>

#include "irreps/fiber.hpp"

namespace bitr::irreps {

/// result[component] += coefficient · a[i] · b[j].
struct CouplingTerm {
  int component, i, j;
  double coefficient;
};

/// D^out within D^a ⊗ D^b, by component: the matrices of clebsch_gordan.hpp of the first side times those of
/// the second, without their zeros. Both sides: |a − b| ≤ out ≤ a + b ≤ 2 max_coupled_degree.
std::vector<CouplingTerm> coupling_terms(Degree a, Degree b, Degree out);

}  // namespace bitr::irreps
