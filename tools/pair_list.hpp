// Pairs with known answers, to be evaluated on.
#pragma once

#include <bitr/data.hpp>
#include <string>
#include <vector>

#include "output.hpp"

namespace bitr::tool {

/// The pairs of a manifest, held in memory. A published truth is often near the identity and can be met by
/// accident: every sample moves both clouds by random motions.
class PairList {
 public:
  /// Meshes are sampled, with a seed each. `bad_file`, `not_found` or `io`, naming the file: of a pair that
  /// cannot be read or has no truth, and of a manifest without pairs.
  static Result<PairList> open(const std::string& manifest);

  std::size_t pairs() const { return pairs_.size(); }
  /// A file without normals; empty when every cloud has them.
  const std::string& without_normals() const { return without_normals_; }
  /// What was read: clouds and truths.
  const InputFiles& files() const { return files_; }
  /// Pair index mod pairs(): of each cloud `points` at most, by chance; a motion up to the cloud's own
  /// length. The object's origin is the source's middle.
  DataSample sample(std::size_t index, std::size_t points, std::uint64_t seed) const;

 private:
  struct Known {
    std::string name;
    PointCloud source, reference;
    Pose T_reference_source;
  };
  std::vector<Known> pairs_;
  std::string without_normals_;
  InputFiles files_;
};

}  // namespace bitr::tool
