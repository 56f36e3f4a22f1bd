// edge_geometry: lengths and directions of the edges neighbour → centre, side by side.
//   d = centre − neighbour
// in  centres T[Q, 3·sides]
// in  neighbours T[P, 3·sides]
// in  index u32[Q, k]
// out lengths T[Q, k, sides]
// out directions T[Q, k, 3·sides]
//       unit vectors in the order (y, z, x); the zero vector where the length is 0
// error float_error(), relative to the largest entry of the output
#pragma once

namespace bitr::ops {

struct EdgeGeometry {
  int sides = 1;

  double float_error() const { return 2e-5; }
};

/// torch.normalize's guard: shorter vectors are divided by this instead of their length.
constexpr double direction_eps = 1e-12;

}  // namespace bitr::ops
