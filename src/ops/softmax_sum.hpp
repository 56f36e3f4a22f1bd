// softmax_sum: cloud_softmax and cloud_sum in one, without storing the weights.
// Sums are accumulated in double precision.
// in  logits T[P, width]        the first `channels` columns are used
// in  values T[P, width_i]      one or more; columns [skip_i, width_i) are summed
// out sums T[clouds·channels, width_i − skip_i]    one per values tensor
// error float_error(), relative to the largest entry of the output
#pragma once

#include <vector>

namespace bitr::ops {

struct SoftmaxSum {
  int channels = 1;
  std::vector<int> skip;  ///< one per values tensor

  double float_error() const { return 2e-5; }
  static constexpr double gradient_error = 1e-5;  ///< Gradient::float_error(), on Vulkan
};

}  // namespace bitr::ops
