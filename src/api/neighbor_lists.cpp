#include "api/neighbor_lists.hpp"

#include <algorithm>

namespace bitr {
namespace {

double squared_distance(const NeighborSearchData& search, std::size_t query, std::uint32_t row) {
  double sum = 0;
  for (std::size_t a = 0; a < search.dim; ++a) {
    const double d = search.queries[query * search.dim + a] - search.references[row * search.dim + a];
    sum += d * d;
  }
  return sum;
}

}  // namespace

std::size_t count_wrong_neighbors(const NeighborSearchData& search, std::span<const std::uint32_t> found,
                                  std::span<const std::uint32_t> expected) {
  const std::size_t rows = search.references.size() / search.dim;
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    if (found[i] == expected[i]) continue;
    const std::size_t query = i / search.k;
    const auto list = found.subspan(query * search.k, search.k);
    const bool tie =
        found[i] < rows && std::ranges::count(list, found[i]) == 1 &&
        squared_distance(search, query, found[i]) == squared_distance(search, query, expected[i]);
    wrong += !tie;
  }
  return wrong;
}

}  // namespace bitr
