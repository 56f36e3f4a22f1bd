// How much of two clouds lies on each other.
#pragma once

#include <bitr/assemble.hpp>

#include "refine/workers.hpp"

namespace bitr::refine {

/// Refinement::overlap_before of a finite pose: the larger of the clouds' shares that have a counterpart.
/// Both have at least 3 points.
double overlap_at(const CloudPair& pair, const Pose& T_reference_source, const Workers& workers);

}  // namespace bitr::refine
