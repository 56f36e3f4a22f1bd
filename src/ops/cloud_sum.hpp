// cloud_sum: weighted sums over the points of each cloud, accumulated in double precision.
//   out[cloud, c] = Σ_p weights[p, c] values[p]
// in  weights T[P, channels]
// in  values T[P, width]        columns [skip, width) are summed
// out sums T[clouds·channels, width − skip]
// error float_error(), relative to the largest entry of the output
#pragma once

namespace bitr::ops {

struct CloudSum {
  int channels = 1;
  int skip = 0;  ///< leading columns of the values that are left out

  double float_error() const { return 1e-6; }
};

}  // namespace bitr::ops
