// What the clouds themselves say of a pose.
#pragma once

#include <bitr/confidence.hpp>

#include "refine/workers.hpp"

namespace bitr::confidence {

/// Needs a finite pose and clouds with at least 3 points; what comes from a network stays empty.
Evidence evidence_of_fit(const CloudPair& pair, const Pose& T_reference_source,
                         const refine::Workers& workers);

}  // namespace bitr::confidence
