// sum: adds tensors of one shape in the order given.
// in  addends T[rows, width]    two or more
// out sum T[rows, width]
// error 2e-5 (float, against double), relative to the largest entry of the output
#pragma once

namespace bitr::ops {

struct Sum {};

}  // namespace bitr::ops
