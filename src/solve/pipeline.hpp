// One pair, from prepared clouds to settled poses.
#pragma once

#include <functional>
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

/// What others propose, given the level: networks' answers.
using MoreProposals = std::function<std::vector<Candidate>(const LevelPair&)>;

/// Goes on proposing, by one rule after the other and then on a finer level, until the best pose is beyond doubt or
/// nothing is left to try.
Settled find_poses(const Prepared& source, const Prepared& reference, bool geometry,
                   const MoreProposals& more, ThreadPool& pool);

}  // namespace bitr::solving
