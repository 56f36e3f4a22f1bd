// attend: softmax attention of every centre over its k edges, head by head.
//   e_hj = ⟨k_hj, q_h⟩/√(Σ dim(d))    over the degrees d of the keys
//   out_h = Σ_j softmax_j(e_h) v_hj
// Head h owns channels [h·m/heads, (h+1)·m/heads) of every degree.
// in  values T[Q, k, values_fiber]   the first channels are used
// in  keys T[Q, k, keys_fiber]       the last channels are used
// in  queries T[Q, key_fiber]        without this input queries are zero and attention is uniform
// out logits T[Q, k, heads]
// out weights T[Q, k, heads]
// out sums T[Q, value_fiber]
// error float_error(), relative to the largest entry of the output
#pragma once

#include "irreps/fiber.hpp"

namespace bitr::ops {

struct Attend {
  int heads = 1;
  irreps::Fiber value_fiber, key_fiber;    ///< the channels that are used
  irreps::Fiber values_fiber, keys_fiber;  ///< the whole rows they are part of

  /// Logits of trained models reach far into the exponent: 8.0e-5 was measured.
  double float_error() const { return 1e-4; }
};

}  // namespace bitr::ops
