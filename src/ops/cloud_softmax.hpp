// cloud_softmax: softmax over the points of each cloud, channel by channel.
// in  logits T[P, width]        the first `channels` columns are used
// out weights T[P, channels]
// error float_error(), relative to the largest entry of the output
#pragma once

namespace bitr::ops {

struct CloudSoftmax {
  int channels = 1;

  double float_error() const { return 2e-5; }
};

}  // namespace bitr::ops
