// linear: mixes channels degree by degree, the same for every component; no bias.
//   out[d] = W[d] [in₀ ; in₁ ; …][d]  (+ in[d] where `skip` has d: channel counts are equal there)
// in  features T[rows, fiber_in[i]]    one or more, concatenated along channels degree by degree
// out features T[rows, fiber_out]
// error float_error(), relative to the largest entry of the output
#pragma once

#include <Eigen/Core>
#include <map>
#include <set>
#include <vector>

#include "irreps/fiber.hpp"

namespace bitr::ops {

using DegreeMatrices = std::map<irreps::Degree, Eigen::MatrixXd>;

struct Linear {
  std::vector<irreps::Fiber> fiber_in;
  irreps::Fiber fiber_out;
  DegreeMatrices weights;  ///< channels out × channels in, per degree of fiber_out
  std::set<irreps::Degree> skip;

  double float_error() const { return 2e-5; }
};

}  // namespace bitr::ops
