// linear: mixes channels degree by degree, the same for every component; no bias.
// in  one or more T[rows, fiber_in[i]], concatenated along channels degree by degree
// out T[rows, fiber_out]; where `skip` has the degree, the input is added (channel counts are equal there)
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
};

}  // namespace bitr::ops
