// input_features: what a point starts with.
//   degree (0,0): the constant 0.5, or the colour; with offsets also |o| and, with normals as well, ⟨n, o⟩
//   degree (1,0), in the order (y, z, x): the normal n, if used; the offset o, if used
// The offset is a point's position from its cloud's centroid, over the root mean square of the cloud's
// offsets: it turns with the cloud, and its length does not change with the cloud's scale.
// in  colors T[P, 3]            if `colors`
// in  normals T[P, 3]           if `normals`
// in  offsets T[P, 3]           if `offsets`
// out features T[P, fiber]
// error float_error(), relative to the largest entry of the output
#pragma once

#include "irreps/fiber.hpp"

namespace bitr::ops {

constexpr double constant_feature = 0.5;

struct InputFeatures {
  bool colors = false;
  bool normals = false;
  bool offsets = false;

  irreps::Fiber fiber() const {
    irreps::Fiber fiber{{{0, 0}, (colors ? 3 : 1) + (offsets ? 1 : 0) + (offsets && normals ? 1 : 0)}};
    if (normals || offsets) fiber.set({1, 0}, normals && offsets ? 2 : 1);
    return fiber;
  }
  double float_error() const { return offsets ? 1e-6 : 0; }
};

}  // namespace bitr::ops
