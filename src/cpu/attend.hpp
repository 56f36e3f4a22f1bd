// Which channels a head of the attention owns.
#pragma once

#include <vector>

#include "irreps/fiber.hpp"

namespace bitr::cpu {

/// One degree's channels of one head: where they lie in the tensor read and in the tensor written (or the
/// query).
struct HeadRun {
  int head, from, to, length;
};

/// The channels of `used`, which are the first of `whole`, or the last.
inline std::vector<HeadRun> head_runs(const irreps::Fiber& used, const irreps::Fiber& whole, int heads,
                                      bool last) {
  std::vector<HeadRun> runs;
  for (const auto& [d, m] : used) {
    const int length = m / heads * d.dim();
    const int from = whole.offset(d) + (last ? (whole.channels(d) - m) * d.dim() : 0);
    for (int h = 0; h < heads; ++h)
      runs.push_back({h, from + h * length, used.offset(d) + h * length, length});
  }
  return runs;
}

}  // namespace bitr::cpu
