// What networks say, weighed against what the surfaces say.
#pragma once

#include <bitr/solve.hpp>
#include <string>
#include <vector>

#include "solve/ask.hpp"
#include "solve/pipeline.hpp"

namespace bitr::solving {

/// A pair on its way.
struct Work {
  Prepared source, reference;
  std::string hopeless;  ///< why nothing can be said, if so
  Settled settled = {};
  std::vector<Reply> replies = {};

  const LevelPair& level() const { return *settled.level; }
  /// Thin parts fit turned over as well, and only who knows the whole can tell: so a network that is shown the normals
  /// it reads is asked unless the surfaces share too much for chance.
  bool in_doubt() const;
  /// Of their own, both clouds.
  bool has_normals() const { return !source.cloud.normals.empty() && !reference.cloud.normals.empty(); }
};

/// That one of the settled poses is right: which of them may be open.
double together(const Settled& settled);

/// Settles what the networks propose, doubts what they say of themselves, and shares between their answers and the
/// settled poses what is certain.
void take_replies(Work& work, std::vector<Reply> replies, const SolveOptions& options, ThreadPool& pool);

}  // namespace bitr::solving
