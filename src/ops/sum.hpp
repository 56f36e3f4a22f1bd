// sum: of tensors of one shape, in the order given.
// in  two or more T[rows, width]     out T[rows, width]
#pragma once

namespace bitr::ops {

struct Sum {};

}  // namespace bitr::ops
