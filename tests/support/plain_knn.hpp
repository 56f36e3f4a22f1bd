// Nearest neighbours by looking at everything: what ops/knn.hpp promises, tie for tie.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

namespace bitr::test {

/// Σ (a − b)² in T, axis by axis, never contracted.
template <class T>
T squared_distance(const T* a, const T* b, int dim) {
  T sum = 0;
  for (int i = 0; i < dim; ++i) {
    const volatile T d = a[i] - b[i], square = d * d;
    sum = sum + square;
  }
  return sum;
}

/// The k nearest of the references [begin, end), without row `self`.
template <class T>
std::vector<std::uint32_t> nearest_rows(const T* query, const T* references, std::size_t begin,
                                        std::size_t end, std::size_t self, int k, int dim) {
  std::vector<std::pair<T, std::uint32_t>> all;
  for (std::size_t r = begin; r < end; ++r)
    if (r != self)
      all.emplace_back(squared_distance(query, references + r * dim, dim), static_cast<std::uint32_t>(r));
  std::partial_sort(all.begin(), all.begin() + k, all.end());
  std::vector<std::uint32_t> rows;
  for (int i = 0; i < k; ++i) rows.push_back(all[i].second);
  return rows;
}

}  // namespace bitr::test
