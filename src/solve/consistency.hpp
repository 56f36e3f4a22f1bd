// Which pairings can be true at once, and the rigid motions that groups of them agree on.
#pragma once

#include <bitr/pose.hpp>
#include <span>
#include <vector>

#include "core/thread_pool.hpp"
#include "solve/level.hpp"
#include "solve/matching.hpp"

namespace bitr::solving {

struct Hypothesis {
  Pose T;              ///< centred source to centred reference
  double support = 0;  ///< pairings that it brings together
};

/// Consensus sets: two pairings are consistent when the source's points are as far apart as the reference's, to
/// within a resolution, and their normals, up to sign, stand alike to each other and to the line between them.
/// Two consistent pairings count by how many others both are consistent with (second-order spatial
/// compatibility: Chen et al., 2022). Around each well connected pairing the most consistent ones, weighted by
/// the leading eigenvector, make a motion, which is fitted anew to all pairings that it brings together. At
/// most `most` hypotheses, best supported first.
std::vector<Hypothesis> consensus(const Level& source, const Level& reference,
                                  std::span<const Pairing> pairings, std::size_t most, ThreadPool& pool);

}  // namespace bitr::solving
