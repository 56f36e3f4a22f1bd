#include "irreps/harmonics.hpp"

#include <array>
#include <cmath>

namespace bitr::irreps {
namespace {

// √(2 (l−m)! / (l+m)!), without the 2 at m = 0: Schmidt's semi-normalisation.
double schmidt(int l, int m) {
  double ratio = 1;
  for (int i = l - m + 1; i <= l + m; ++i) ratio /= i;
  return std::sqrt(m == 0 ? ratio : 2 * ratio);
}

using Norms = std::array<std::array<double, max_harmonic_degree + 1>, max_harmonic_degree + 1>;

const Norms norms = [] {
  Norms table{};
  for (int l = 0; l <= max_harmonic_degree; ++l)
    for (int m = 0; m <= l; ++m) table[l][m] = schmidt(l, m);
  return table;
}();

}  // namespace

template <class T>
void spherical_harmonics(int max_degree, const T* xyz, T* out) {
  const T x = xyz[0], y = xyz[1], z = xyz[2], r2 = x * x + y * y + z * z;
  T real = 1, imaginary = 0;  // (x + iy)^m
  T diagonal = 1;             // (2m−1)!!
  for (int m = 0; m <= max_degree; ++m) {
    // Legendre's recurrence in l, kept homogeneous: q = |v|^(l−m) d^m/dz^m P_l(z/|v|) up to the sign
    // convention.
    T below = 0, q = diagonal;
    for (int l = m; l <= max_degree; ++l) {
      const T scaled = static_cast<T>(norms[l][m]) * q;
      out[l * l + l + m] = scaled * real;
      if (m > 0) out[l * l + l - m] = scaled * imaginary;
      const T next = (static_cast<T>(2 * l + 1) * z * q - static_cast<T>(l + m) * r2 * below) /
                     static_cast<T>(l - m + 1);
      below = q;
      q = next;
    }
    const T rotated = real * x - imaginary * y;
    imaginary = real * y + imaginary * x;
    real = rotated;
    diagonal *= static_cast<T>(2 * m + 1);
  }
}

template void spherical_harmonics<float>(int, const float*, float*);
template void spherical_harmonics<double>(int, const double*, double*);

}  // namespace bitr::irreps
