#include "irreps/coupling.hpp"

#include <cmath>

#include "irreps/clebsch_gordan.hpp"

namespace bitr::irreps {
namespace {

// What is zero comes out of sums of square roots a few rounding errors off; the least coefficient of degrees
// ≤ 4 is about 0.03.
constexpr double rounding = 1e-12;

std::vector<CouplingTerm> one_side(int a, int b, int out) {
  const Eigen::MatrixXd q = clebsch_gordan_block(a, b, out);
  std::vector<CouplingTerm> terms;
  for (int m = 0; m < q.cols(); ++m)
    for (int row = 0; row < q.rows(); ++row)
      if (std::abs(q(row, m)) > rounding)
        terms.push_back({m, row / (2 * b + 1), row % (2 * b + 1), q(row, m)});
  return terms;
}

}  // namespace

std::vector<CouplingTerm> coupling_terms(Degree a, Degree b, Degree out) {
  const auto first = one_side(a.p, b.p, out.p), second = one_side(a.q, b.q, out.q);
  std::vector<std::vector<CouplingTerm>> by_component(static_cast<std::size_t>(out.dim()));
  for (const CouplingTerm& s : first)
    for (const CouplingTerm& t : second) {
      const int component = s.component * (2 * out.q + 1) + t.component;
      by_component[component].push_back(
          {component, s.i * (2 * a.q + 1) + t.i, s.j * (2 * b.q + 1) + t.j, s.coefficient * t.coefficient});
    }
  std::vector<CouplingTerm> terms;
  for (const auto& some : by_component) terms.insert(terms.end(), some.begin(), some.end());
  return terms;
}

}  // namespace bitr::irreps
