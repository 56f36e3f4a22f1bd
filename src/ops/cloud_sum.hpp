// cloud_sum: weighted sums over the points of each cloud, in double precision.
// in  weights T[P, channels]   in  values T[P, width]
// out T[clouds · channels, width − skip], columns [skip, width) of the values
#pragma once

namespace bitr::ops {

struct CloudSum {
  int channels = 1;
  int skip = 0;  ///< leading columns of the values that are left out
};

}  // namespace bitr::ops
