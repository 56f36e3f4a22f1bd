// What one channel of a neighbour's feature contributes to the paths of point_attention, and the adjoint.
// Degree-1 paths are spanned by v f⁰, f¹, v × f¹ and v (v·f¹): the Clebsch–Gordan products of
// ops/point_attention.hpp are fixed combinations of them, which belong into the coefficients.
// dv is the gradient with respect to v as if its three entries were independent.
#pragma once

namespace bitr::cpu {

/// f.
template <class P>
struct Identity {
  static constexpr int inputs = 1, paths = 1;
  static constexpr bool directed = false;
  static void products(const P* f, const P*, P* phi) { phi[0] = f[0]; }
  static void adjoint(const P* g, const P*, const P*, P* df, P*) { df[0] = g[0]; }
};

/// f⁰, v f⁰.
template <class P>
struct ScalarPaths {
  static constexpr int inputs = 1, paths = 4;
  static constexpr bool directed = true;
  static void products(const P* f, const P* v, P* phi) {
    phi[0] = f[0];
    for (int a = 0; a < 3; ++a) phi[1 + a] = v[a] * f[0];
  }
  static void adjoint(const P* g, const P* f, const P* v, P* df, P* dv) {
    df[0] = g[0] + v[0] * g[1] + v[1] * g[2] + v[2] * g[3];
    for (int a = 0; a < 3; ++a) dv[a] = f[0] * g[1 + a];
  }
};

/// v·f¹.
template <class P>
struct Along {
  static constexpr int inputs = 3, paths = 1;
  static constexpr bool directed = true;
  static void products(const P* f, const P* v, P* phi) { phi[0] = v[0] * f[0] + v[1] * f[1] + v[2] * f[2]; }
  static void adjoint(const P* g, const P* f, const P* v, P* df, P* dv) {
    for (int a = 0; a < 3; ++a) df[a] = g[0] * v[a];
    for (int a = 0; a < 3; ++a) dv[a] = g[0] * f[a];
  }
};

/// v·f¹, f¹, v × f¹, v (v·f¹).
template <class P>
struct VectorPaths {
  static constexpr int inputs = 3, paths = 10;
  static constexpr bool directed = true;
  static void products(const P* f, const P* v, P* phi) {
    const P along = v[0] * f[0] + v[1] * f[1] + v[2] * f[2];
    phi[0] = along;
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, c = (a + 2) % 3;
      phi[1 + a] = f[a];
      phi[4 + a] = v[b] * f[c] - v[c] * f[b];
      phi[7 + a] = v[a] * along;
    }
  }
  static void adjoint(const P* g, const P* f, const P* v, P* df, P* dv) {
    const P along = v[0] * f[0] + v[1] * f[1] + v[2] * f[2];
    const P g_along = g[0] + v[0] * g[7] + v[1] * g[8] + v[2] * g[9];
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, c = (a + 2) % 3;
      df[a] = g[1 + a] + (g[4 + b] * v[c] - g[4 + c] * v[b]) + g_along * v[a];
      dv[a] = (f[b] * g[4 + c] - f[c] * g[4 + b]) + g_along * f[a] + along * g[7 + a];
    }
  }
};

/// v.
template <class P>
struct Direction {
  static constexpr int inputs = 0, paths = 3;
  static constexpr bool directed = true;
  static void products(const P*, const P* v, P* phi) {
    for (int a = 0; a < 3; ++a) phi[a] = v[a];
  }
  static void adjoint(const P* g, const P*, const P*, P*, P* dv) {
    for (int a = 0; a < 3; ++a) dv[a] = g[a];
  }
};

}  // namespace bitr::cpu
