// input_features: degree (0,0): the constant 0.5, or the colour; degree (1,0), if normals are used: (y, z,
// x). in  colors T[P, 3] if used, then normals T[P, 3] if used     out T[P, fiber]
#pragma once

#include "irreps/fiber.hpp"

namespace bitr::ops {

constexpr double constant_feature = 0.5;

struct InputFeatures {
  bool colors = false;
  bool normals = false;

  irreps::Fiber fiber() const {
    irreps::Fiber fiber{{{0, 0}, colors ? 3 : 1}};
    if (normals) fiber.set({1, 0}, 1);
    return fiber;
  }
};

}  // namespace bitr::ops
