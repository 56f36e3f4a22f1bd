// sum: adds tensors of one shape in the order given.
// in  addends T[rows, width]    two or more
// out sum T[rows, width]
// error float_error(), relative to the largest entry of the output
#pragma once

namespace bitr::ops {

struct Sum {
  double float_error() const { return 1e-5; }
};

}  // namespace bitr::ops
