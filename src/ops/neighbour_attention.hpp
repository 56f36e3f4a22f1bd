// neighbour_attention: softmax attention of every query over its k neighbours, every head on its own.
//   e_ij = scale · ⟨q_i, k_j⟩
//   out_i = Σ_j softmax_j(e_ij) v_j   over j in index[i]
// Heads are entries of a row.
// in  queries T[Q, heads, D]
// in  keys T[P, heads, D]
// in  values T[P, heads, V]
// in  index u32[Q, k]           k ≤ 64
// out sums T[Q, heads, V]
// error float_error(), relative to the largest |v|, at |e| ≤ 30 and D ≤ 256
#pragma once

namespace bitr::ops {

struct NeighbourAttention {
  double scale = 1;

  double float_error() const { return 1e-5; }
};

}  // namespace bitr::ops
