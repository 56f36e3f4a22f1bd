// merge_pairs: key point c of the source with key point c of the reference: one node of the 6-D graph.
//   (0,0): sum; (1,0): the source's; (0,1): the reference's; (1,1): outer product per channel
// in  positions T[clouds·K, 3]
// in  features T[clouds·K, {(0,0): m, (1,0): m}]
// out positions T[pairs·K, 6]
// out features T[pairs·K, merged()]
// error float_error(), relative to the largest entry of the output
#pragma once

#include "irreps/fiber.hpp"

namespace bitr::ops {

struct MergePairs {
  int channels = 4;

  irreps::Fiber merged() const {
    return {{{0, 0}, channels}, {{0, 1}, channels}, {{1, 0}, channels}, {{1, 1}, channels}};
  }
  double float_error() const { return 2e-7; }
  static constexpr double gradient_error = 1e-5;  ///< Gradient::float_error(), on Vulkan
};

}  // namespace bitr::ops
