// The projected ReLU's gradient, shared by the gradients of every kernel that ends with it.
#pragma once

#include <algorithm>
#include <cmath>

#include "cpu/kernel.hpp"

namespace bitr::cpu {

/// x: what the ReLU read, channels × dim of one degree; d: the gradient of what it made, becomes that of x,
/// in place; d_plane: added to, channels × channels with the channel of `mixed` fastest (as Eigen keeps a
/// matrix).
template <class T>
void projected_relu_gradient(const RowMatrix<T>& plane, bool square, int dim, const T* x, T* d, T* d_plane) {
  constexpr int most = 256 * 9;
  T d_mixed[most], d_own[most];
  const int channels = static_cast<int>(plane.rows());
  const T weight = static_cast<T>(1 - ops::leaky_slope), floor = static_cast<T>(ops::plane_norm_floor);
  std::fill_n(d_mixed, channels * dim, T{0});
  std::copy_n(d, channels * dim, d_own);
  bool any = false;
  for (int c = 0; c < channels; ++c) {
    T mixed[9] = {}, along = 0, length2 = 0;
    for (int j = 0; j < channels; ++j)
      for (int m = 0; m < dim; ++m) mixed[m] += plane(c, j) * x[j * dim + m];
    for (int m = 0; m < dim; ++m) {
      along += x[c * dim + m] * mixed[m];
      length2 += mixed[m] * mixed[m];
    }
    if (along >= 0) continue;
    any = true;
    // out = x − w·p·u, u = mixed/n, n = |mixed| or |mixed|², floored.
    const T length = std::sqrt(length2), norm = std::max(length, floor), n = square ? norm * norm : norm;
    T d_along = 0;
    for (int m = 0; m < dim; ++m) d_along -= weight / n * d[c * dim + m] * mixed[m];
    // p enters through mixed as well; n does where it is not the floor.
    const T d_n = length > floor ? -along / n * d_along : 0;
    const T back = length > floor ? (square ? 2 * d_n : d_n / length) : 0;
    for (int m = 0; m < dim; ++m) {
      d_own[c * dim + m] += d_along * mixed[m];
      d_mixed[c * dim + m] =
          -weight * along / n * d[c * dim + m] + d_along * x[c * dim + m] + back * mixed[m];
    }
  }
  std::copy_n(d_own, channels * dim, d);
  if (!any) return;
  for (int j = 0; j < channels; ++j)
    for (int c = 0; c < channels; ++c) {
      T sum = 0;
      for (int m = 0; m < dim; ++m) {
        sum += d_mixed[c * dim + m] * x[j * dim + m];
        d[j * dim + m] += plane(c, j) * d_mixed[c * dim + m];
      }
      d_plane[j * channels + c] += sum;
    }
}

}  // namespace bitr::cpu
