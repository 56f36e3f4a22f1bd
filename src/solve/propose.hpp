// Poses that the geometry of two clouds suggests. None depends on the frames of the clouds.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "solve/consistency.hpp"
#include "solve/judge.hpp"
#include "solve/prepare.hpp"
#include "solve/settle.hpp"

namespace bitr::solving {

/// A pose, where it came from, and how it fits.
struct Candidate {
  Pose T;              ///< centred source to centred reference
  double support = 0;  ///< matched points that proposed it
  std::string from;
  Fit fit = {};
};

/// Which signs the normals of both clouds get before their surroundings are compared.
struct SignRule {
  Signs signs;
  bool
      facing;  ///< the reference's are turned over: pieces that touch show each other their outsides, and one
               ///< cloud's normals may point the wrong way
};

/// Proposals on one level, with what they share.
class Proposer {
 public:
  Proposer(const LevelPair& level, ThreadPool& pool);
  /// Of points whose surroundings look alike (descriptors at several radii), under one rule.
  std::vector<Candidate> of_matches(SignRule rule);
  /// Of the clouds' principal axes.
  std::vector<Candidate> of_axes() const;

 private:
  struct Described {
    std::vector<Descriptors> source, reference;
  };
  const Described& described(Signs signs);

  const LevelPair& level_;
  ThreadPool& pool_;
  std::map<Signs, Described> described_;
};

/// In resolutions: how far descriptors look, and how many neighbours they look at, at most.
inline constexpr double descriptor_radii[] = {4, 7, 10};
inline constexpr std::size_t descriptor_neighbours = 150;

/// A pose turned by half a turn about each of the source's principal axes, as far as it touches the reference:
/// what an object that looks alike after such a turn is taken for.
std::vector<Candidate> turned_over(const LevelPair& level, const Candidate& candidate);

}  // namespace bitr::solving
