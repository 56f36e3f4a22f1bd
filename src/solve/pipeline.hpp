// One pair, from prepared clouds to settled poses.
#pragma once

#include <bitr/restriction.hpp>
#include <memory>
#include <vector>

#include "solve/propose.hpp"

namespace bitr::solving {

struct Settled {
  std::unique_ptr<LevelPair> level;
  std::vector<Candidate> poses;     ///< distinct, best first
  std::vector<double> confidences;  ///< of each
  std::vector<double> slacks;       ///< of the first few; see slack()
};

/// Goes on proposing, by one rule after the other and then on a finer level, until the best pose is beyond doubt or
/// nothing is left to try. Without geometry there is a level and no pose.
Settled find_poses(const Prepared& source, const Prepared& reference, bool geometry, ThreadPool& pool);

/// With more poses among them, settled like the others.
Settled with_more(Settled settled, std::vector<Candidate> candidates, ThreadPool& pool);

/// Every pose taken to the nearest of a family and judged there: none is more likely than it was.
Settled within(const Restriction& restriction, Settled settled, ThreadPool& pool);

}  // namespace bitr::solving
