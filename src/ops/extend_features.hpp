// extend_features: appends what the clouds tell each other before key points are chosen.
//   degree 0: [own ; global(self) ; global(other) ; mean₀(self) ; mean₀(other)]
//   degree 1: [own ; mean₁(self)]
// "self" is the point's cloud, "other" the other cloud of its pair.
// in  features T[P, fiber]
// in  means T[clouds, fiber]
// in  globals T[clouds, global_channels]
// out features T[P, extended()]
// error float_error() is 0: numbers are copied
#pragma once

#include "irreps/fiber.hpp"

namespace bitr::ops {

struct ExtendFeatures {
  irreps::Fiber fiber;
  int global_channels = 4;

  irreps::Fiber extended() const {
    return {{{0, 0}, 3 * fiber.channels({0, 0}) + 2 * global_channels}, {{1, 0}, 2 * fiber.channels({1, 0})}};
  }
  double float_error() const { return 0; }
};

}  // namespace bitr::ops
