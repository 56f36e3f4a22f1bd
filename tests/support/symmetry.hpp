// Symmetries of the true poses that the loss compares with.
#pragma once

#include <algorithm>

#include "ops/loss.hpp"
#include "support/random_motion.hpp"

namespace bitr::test {

/// The last numbers of a truth (ops/loss.hpp) of every kind in turn: none, some turns, any angle.
inline void any_symmetry(Random& random, std::size_t which, double* numbers) {
  std::copy(ops::no_symmetry.begin(), ops::no_symmetry.end(), numbers);
  if (which % 3 == 0) return;
  const auto rotation = random.rotation();
  std::copy_n(rotation.begin(), 3, numbers);
  for (int a = 3; a < 6; ++a) numbers[a] = random.normal();
  numbers[6] = which % 3 == 1 ? ops::no_symmetry[6] / 3 : 0;
}

}  // namespace bitr::test
