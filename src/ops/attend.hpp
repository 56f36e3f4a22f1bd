// attend: softmax attention of every centre over its k edges, per head.
// in  values T[Q, k, values_fiber], first channels   in  keys T[Q, k, keys_fiber], last channels
// in  queries T[Q, key_fiber]   (no input: zero queries, uniform attention)
// out logits T[Q, k, heads]   out weights T[Q, k, heads]   out T[Q, value_fiber]
// Head h owns channels [h·m/heads, (h+1)·m/heads) of every degree; logits are ⟨k, q⟩/√(Σ dim(d)).
#pragma once

#include "irreps/fiber.hpp"

namespace bitr::ops {

struct Attend {
  int heads = 1;
  irreps::Fiber value_fiber, key_fiber;    ///< what is used
  irreps::Fiber values_fiber, keys_fiber;  ///< of the tensors it is used from
};

}  // namespace bitr::ops
