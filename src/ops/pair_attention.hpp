// pair_attention: a two-sided attention layer, its messages in the edges' own frames.
// Its degrees are {(0,0), (0,1), (1,0), (1,1)}. F₁ and F₂ rotate the two directions onto the first axis;
// there the kernel commutes with SO(2)×SO(2), so per side only these survive, with r ↦ c their coefficients
// (exact change of basis from J):
//   0→0          c
//   0→1 and 1→0  c along the axis
//   1→1          c₀ on the axis, c₁·1 + c₂·𝒥 on the plane, 𝒥 = [[0,−1],[1,0]]
// A two-sided kernel is the tensor product of the two sides' terms. Edges of length zero on a side keep J = 0
// only. Radial coefficients come from sector tables (ops/sector_table.hpp).
// in  features T[pairs·K, fiber_in]
// in  index u32[pairs·K, k]
// in  positions T[pairs·K, 6]
// out features T[pairs·K, fiber_out]
// error float_error(), relative to the largest entry of the output
#pragma once

#include <algorithm>
#include <vector>

#include "ops/projected_relu.hpp"
#include "ops/sector_table.hpp"

namespace bitr::ops {

/// One (degree in → degree out) part of the messages.
struct PairBlock {
  irreps::Degree in, out;
  int in_channels = 0, out_channels = 0;
  int out_begin = 0;     ///< first channel within the degree's [values ; keys]
  int coefficients = 0;  ///< start of (freq, out_channels, in_channels) in the edge's coefficient vector
  int freq() const { return (2 * std::min(in.p, out.p) + 1) * (2 * std::min(in.q, out.q) + 1); }
};

struct PairAttention {
  int heads = 1;
  irreps::Fiber fiber_in, fiber_out;
  irreps::Fiber value_fiber, key_fiber;
  std::vector<PairBlock> blocks;
  std::vector<SectorTable> tables;  ///< each adds to a range of the coefficient vector
  int coefficient_count = 0;
  DegreeMatrices query;    ///< key channels × in channels, skip and 1/√Σdim included
  DegreeMatrices project;  ///< out channels × value channels
  DegreeMatrices self;     ///< out channels × in channels; empty at scale degree 1
  bool relu = false;
  DegreeMatrices planes;
  bool relu_square = false;  ///< ops::ProjectedRelu::square

  double float_error() const { return relu_error(5e-5, relu_square); }
};

}  // namespace bitr::ops
