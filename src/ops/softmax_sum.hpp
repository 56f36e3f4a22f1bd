// softmax_sum: cloud_softmax and cloud_sum in one, without storing the weights.
// in  logits T[P, width], of which the first `channels` columns are used
// in  one or more values T[P, width_i]; columns [skip_i, width_i) are summed
// out one T[clouds · channels, width_i − skip_i] per values tensor, accumulated in double precision
#pragma once

#include <vector>

namespace bitr::ops {

struct SoftmaxSum {
  int channels = 1;
  std::vector<int> skip;  ///< one per values tensor
};

}  // namespace bitr::ops
