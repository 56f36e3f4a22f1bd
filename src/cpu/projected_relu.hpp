// The projected ReLU of one row, shared by every kernel that ends with it.
#pragma once

#include "cpu/kernel.hpp"

namespace bitr::cpu {

template <class T>
T leaky(T x) {
  return x > 0 ? x : static_cast<T>(ops::leaky_slope) * x;
}

/// x: channels × dim of one degree, in place. plane: channels × channels. square: ops::ProjectedRelu::square.
template <class T>
void projected_relu(const RowMatrix<T>& plane, bool square, int dim, T* x);

/// One row of a fiber, in place.
template <class T>
class RowRelu {
 public:
  RowRelu() = default;
  RowRelu(const irreps::Fiber& fiber, const ops::DegreeMatrices& planes, bool square);
  void apply(T* row) const;

  struct Part {
    irreps::Degree degree;
    int offset, dim;
    RowMatrix<T> plane;
  };
  /// The degrees other than (0, 0).
  const std::vector<Part>& parts() const { return parts_; }

 private:
  int scalars_ = 0;
  bool square_ = false;
  std::vector<Part> parts_;
};

}  // namespace bitr::cpu
