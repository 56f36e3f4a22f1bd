// Lists of nearest neighbours, judged.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace bitr {

/// What a search was given, and how it answers: numbers tight, `dim` a point, `k` rows of references a query.
struct NeighborSearchData {
  std::span<const double> queries, references;
  std::size_t dim = 3, k = 1;
};

/// How many entries of `found` are wrong: neither the row that `expected` has in the same place, nor another
/// one that is exactly as far from the query and in the list only once.
std::size_t count_wrong_neighbors(const NeighborSearchData& search, std::span<const std::uint32_t> found,
                                  std::span<const std::uint32_t> expected);

}  // namespace bitr
