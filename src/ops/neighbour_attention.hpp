// neighbour_attention: softmax attention of every query over its k neighbours, per head.
//   e_ij = scale · ⟨q_i, k_j⟩,   out_i = Σ_j softmax_j(e_ij) v_j   over j in index[i], every head on its own
// in  queries T[Q, heads, D]   in  keys T[P, heads, D]   in  values T[P, heads, V]   in  index u32[Q, k ≤ 64]
// out T[Q, heads, V]           (heads are entries of a row)
// error (float, against double): 1e-5 of the largest |v|, at |e| ≤ 30 and D ≤ 256.
#pragma once

namespace bitr::ops {

struct NeighbourAttention {
  double scale = 1;
};

}  // namespace bitr::ops
