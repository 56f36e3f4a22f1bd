// The projected ReLU's gradient, one row per lane (ops/projected_relu.hpp).
#pragma once

#include "cpu/pack.hpp"
#include "ops/projected_relu.hpp"

namespace bitr::cpu {

/// g: the gradient of the outputs, then of the inputs x.
template <class T>
void differentiate_leaky(int channels, const Pack<T>* x, Pack<T>* g) {
  const Pack<T> none = zero_pack<T>();
  for (int c = 0; c < channels; ++c) g[c] = x[c] > none ? g[c] : static_cast<T>(ops::leaky_slope) * g[c];
}

/// x, g, scratch: 3 × channels. g: the gradient of the outputs, then of the inputs x. Adds to that of the
/// plane.
template <class T>
void differentiate_relu(PackMatrix<T>& plane, int channels, bool square, const Pack<T>* x, Pack<T>* g,
                        Pack<T>* scratch) {
  using P = Pack<T>;
  const P none = zero_pack<T>();
  constexpr T share = static_cast<T>(1 - ops::leaky_slope),
              floor2 = static_cast<T>(ops::plane_norm_floor * ops::plane_norm_floor);
  std::copy_n(g, 3 * channels, scratch);
  for (int c = 0; c < channels; ++c) {
    P d[3], along = none, length2 = none, across = none;
    for (int a = 0; a < 3; ++a) {
      d[a] = none;
      for (int i = 0; i < channels; ++i) d[a] += plane.value(c, i) * x[a * channels + i];
      along += x[a * channels + c] * d[a];
      length2 += d[a] * d[a];
      across += g[a * channels + c] * d[a];
    }
    P norm = length2 > floor2 ? length2 : none + floor2;
    if (!square) as_array<T>(norm) = as_array<T>(norm).sqrt();
    // y = x − factor ⟨x, d⟩ d where ⟨x, d⟩ < 0, the factor being share / |d| or share / |d|².
    const P factor = along < none ? share / norm : none;
    const P bend = length2 > floor2 ? factor * along * across * (square ? T{2} : T{1}) / length2 : none;
    for (int a = 0; a < 3; ++a) {
      const P xc = x[a * channels + c], gc = g[a * channels + c];
      scratch[a * channels + c] -= factor * across * d[a];
      const P dd = bend * d[a] - factor * (across * xc + along * gc);
      for (int i = 0; i < channels; ++i) {
        plane.gradient(c, i) += dd * x[a * channels + i];
        scratch[a * channels + i] += plane.value(c, i) * dd;
      }
    }
  }
  std::copy_n(scratch, 3 * channels, g);
}

}  // namespace bitr::cpu
