// attention_layer: one "encode layer" of the paper, whole.
// Never executed itself: model/expand turns it into convolve, linear and attend (as defined), model/fold into
// point_attention, mean_direction or pair_attention.
// in  features T[P, fiber_in]
// in  index u32[Q, k]
// in  centres T[Q, 3·sides]
// in  neighbours T[P, 3·sides]
// out features T[Q, fiber_out]
// error that of the operations it becomes
#pragma once

#include <optional>

#include "ops/convolve.hpp"
#include "ops/linear.hpp"

namespace bitr::ops {

struct AttentionLayer {
  int sides = 1;
  int scale_degree = 0;
  int heads = 1;
  bool zero_centre = false;  ///< the centres' own features are zero (key points), and are not an input
  irreps::Fiber fiber_in, fiber_out;
  irreps::Fiber value_fiber, key_fiber;
  Convolve values_keys;   ///< scale degree 0: [values ; keys]
  Convolve values, keys;  ///< scale degree 1
  Linear query;           ///< fiber_in → key_fiber
  Linear project;         ///< value_fiber (⊕ fiber_in, scale degree 0) → fiber_out
};

}  // namespace bitr::ops
