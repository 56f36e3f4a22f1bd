// What lowers a confidence, in words for people.
#pragma once

#include <bitr/solve.hpp>
#include <string>
#include <vector>

#include "solve/prepare.hpp"

namespace bitr::solving {

/// Why nothing can be said of two clouds, whatever the pose; empty when something can.
std::string hopeless(const Prepared& source, const Prepared& reference, std::size_t source_points,
                     std::size_t reference_points);
/// What lowers the best pose's confidence, most important first.
std::vector<std::string> reasons(const Solution& solution);

}  // namespace bitr::solving
