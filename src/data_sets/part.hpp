// The parts of a data set, opened: which shapes they have, and how many samples and pools they give.
#pragma once

#include <bitr/data.hpp>
#include <cstdint>
#include <string>
#include <vector>

#include "generate/pairs.hpp"

namespace bitr::data {

/// A part's shapes that are in the split.
struct Part {
  DataPart recipe;
  const generate::ShapeKind* kind = nullptr;    ///< null for files
  std::vector<std::uint32_t> seeds;             ///< a kind's, less first_seed
  std::vector<std::string> files;               ///< below the folder, sorted
  std::uint64_t first_sample = 0, samples = 0;  ///< its share of an epoch in order
  std::uint64_t pools = 0;                      ///< so many of its shapes' versions, the first, have a pool

  /// How its shapes become pairs.
  generate::PairOrigin origin() const {
    return kind && !recipe.protocol ? kind->origin : generate::PairOrigin::cropped;
  }
  /// Ways in which a shape is kept.
  std::size_t versions() const {
    return recipe.pool > 0 && origin() == generate::PairOrigin::broken ? recipe.breaks : 1;
  }
  std::size_t shapes() const { return kind ? seeds.size() : files.size(); }
  std::string name(std::size_t i) const {
    return kind ? std::string(kind->shape) + "/" + std::to_string(recipe.first_seed + seeds[i]) : files[i];
  }
};

/// Whether its clouds are crops, of which `share` is kept.
bool is_cropped(const DataPart& part);

/// Errors as of DataSet::open, without the part's number.
Result<Part> open_part(const DataPart& recipe, const DataOptions& options);

/// A folder within another would give its shapes two names, and so perhaps two splits.
Result<void> check_folders(const std::vector<Part>& parts);

/// Shares `total` samples out by weight: the largest remainders get what is left over.
void share_out(std::vector<Part>& parts, std::uint64_t total);

/// Gives pools to as many shapes as fit in the cache: to make one again each time would take longer than to
/// draw without. Returns the bytes they take.
std::size_t share_pools(std::vector<Part>& parts, std::size_t bytes);

/// `invalid_argument`.
tl::unexpected<Error> wrong(const std::string& message);
/// For an option with two ends: `invalid_argument` unless least ≤ low ≤ high ≤ most.
Result<void> check_range(const std::string& name, double low, double high, double least, double most);

}  // namespace bitr::data
