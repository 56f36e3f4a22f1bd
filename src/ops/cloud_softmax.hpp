// cloud_softmax: softmax over the points of each cloud, channel by channel.
// in  T[P, width]   out T[P, channels], of the first `channels` columns
#pragma once

namespace bitr::ops {

struct CloudSoftmax {
  int channels = 1;
};

}  // namespace bitr::ops
