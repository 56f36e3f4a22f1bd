// What networks answer for a level, as proposals.
#pragma once

#include <bitr/assemble.hpp>
#include <span>
#include <vector>

#include "solve/propose.hpp"

namespace bitr::solving {

/// One candidate per plan that has an answer. Of each cloud at most `points` are shown, with normals under every
/// rule of signs that it has.
std::vector<Candidate> network_proposals(std::span<Plan* const> plans, const LevelPair& level,
                                         std::size_t points);

}  // namespace bitr::solving
