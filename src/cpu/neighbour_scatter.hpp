// What edges hand to the rows they start from, added up in the order of the edges.
#pragma once

#include <algorithm>

#include "cpu/kernel.hpp"

namespace bitr::cpu {

/// edges: T[edges of `index`, stride of `to`]. Overwrites `to`.
template <class T>
void scatter_to_neighbors(const Arguments& args, const Slot& index, const T* edges, const Slot& to) {
  const std::size_t k = index.per_row, width = to.stride();
  const auto* neighbor = index.as<std::uint32_t>();
  T* out = to.as<T>();
  std::fill_n(out, args.rows(to) * width, T{0});
  // A segment's edges lead to its own rows only.
  args.pool.parallel_for(args.layout.segments(index.rows), 1, [&](std::size_t first, std::size_t last) {
    const std::size_t begin = args.layout.begin(index.rows, static_cast<std::uint32_t>(first)) * k,
                      end = args.layout.begin(index.rows, static_cast<std::uint32_t>(last)) * k;
    for (std::size_t e = begin; e < end; ++e)
      for (std::size_t i = 0; i < width; ++i) out[neighbor[e] * width + i] += edges[e * width + i];
  });
}

}  // namespace bitr::cpu
