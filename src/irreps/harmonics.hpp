// Real spherical harmonics as harmonic polynomials, |Y_l(v)| = 1 for every unit vector v and every degree l.
#pragma once

namespace bitr::irreps {

constexpr int max_harmonic_degree = 4;

constexpr int harmonic_count(int max_degree) { return (max_degree + 1) * (max_degree + 1); }

/// Y_0 … Y_L of (x, y, z), order m = −l … l within a degree: out[l² + l + m], harmonic_count(L) numbers.
/// Y_1 = (y, z, x). Homogeneous of degree l, so the zero vector gives Y_l = 0 for l > 0 and Y_0 = 1.
/// 0 ≤ max_degree ≤ max_harmonic_degree.
template <class T>
void spherical_harmonics(int max_degree, const T* xyz, T* out);

}  // namespace bitr::irreps
