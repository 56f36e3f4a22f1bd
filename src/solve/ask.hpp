// What networks answer for pairs whose surfaces leave the pose in doubt: pieces that only meet, or hardly overlap.
#pragma once

#include <bitr/device.hpp>
#include <bitr/model.hpp>
#include <bitr/restriction.hpp>
#include <span>
#include <string>
#include <vector>

#include "solve/prepare.hpp"

namespace bitr::solving {

/// A pair as a network is shown it.
struct Question {
  const Prepared &source, &reference;
  const LevelPair& level;  ///< gives normals to clouds without any
};

struct AskOptions {
  int answers;  ///< for parts of the clouds, see resample()
  Restriction restriction;
};

struct Reply {
  Pose T;                 ///< centred source to centred reference: the mean of the network's answers
  double confidence = 0;  ///< see Confidence::value
  std::vector<std::string> reasons;
  std::string model;
};

/// The replies to every question, one of each model that can read its clouds, in the models' order. A network sees as
/// many points as it was trained on, and normals are the cloud's own or the level's, whose signs then agree between
/// neighbours. Failure as of assemble().
std::vector<std::vector<Reply>> ask(const Device& device, std::span<const Model> models,
                                    const AskOptions& options, std::span<const Question> questions);

}  // namespace bitr::solving
