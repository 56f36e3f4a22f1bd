#include "irreps/clebsch_gordan.hpp"

#include <array>
#include <cmath>
#include <complex>
#include <cstdlib>
#include <numbers>

namespace bitr::irreps {
namespace {

double factorial(int n) {
  double product = 1;
  for (int i = 2; i <= n; ++i) product *= i;
  return product;
}

// ⟨a α b β | J α+β⟩ by Racah's sum.
double coupling(int a, int alpha, int b, int beta, int J) {
  const int M = alpha + beta;
  const double triangle = (2 * J + 1) * factorial(J + a - b) * factorial(J - a + b) * factorial(a + b - J) /
                          factorial(a + b + J + 1);
  const double states = factorial(J + M) * factorial(J - M) * factorial(a - alpha) * factorial(a + alpha) *
                        factorial(b - beta) * factorial(b + beta);
  double sum = 0;
  for (int k = 0; k <= a + b - J; ++k) {
    const std::array<int, 5> terms = {a + b - J - k, a - alpha - k, b + beta - k, J - b + alpha + k,
                                      J - a - beta + k};
    double product = factorial(k);
    bool exists = true;
    for (int term : terms) {
      exists = exists && term >= 0;
      if (exists) product *= factorial(term);
    }
    if (exists) sum += (k % 2 ? -1 : 1) / product;
  }
  return std::sqrt(triangle * states) * sum;
}

// Rows: real harmonics m = −l … l; columns: complex ones (Condon–Shortley phase).
Eigen::MatrixXcd real_from_complex(int l) {
  using namespace std::complex_literals;
  Eigen::MatrixXcd u = Eigen::MatrixXcd::Zero(2 * l + 1, 2 * l + 1);
  u(l, l) = 1;
  for (int m = 1; m <= l; ++m) {
    const double half = 1 / std::numbers::sqrt2, sign = m % 2 ? -1 : 1;
    u(l + m, l - m) = half;
    u(l + m, l + m) = sign * half;
    u(l - m, l - m) = 1i * half;
    u(l - m, l + m) = -1i * sign * half;
  }
  return u;
}

Eigen::MatrixXd compute(int a, int b) {
  const int rows = (2 * a + 1) * (2 * b + 1);
  Eigen::MatrixXcd pair(rows, rows);
  const Eigen::MatrixXcd ua = real_from_complex(a), ub = real_from_complex(b);
  for (int i = 0; i < 2 * a + 1; ++i)
    for (int j = 0; j < 2 * a + 1; ++j)
      pair.block(i * (2 * b + 1), j * (2 * b + 1), 2 * b + 1, 2 * b + 1) = ua(i, j) * ub;

  Eigen::MatrixXd q(rows, rows);
  int column = 0;
  for (int J = std::abs(a - b); J <= a + b; ++J) {
    Eigen::MatrixXcd complex_block = Eigen::MatrixXcd::Zero(rows, 2 * J + 1);
    for (int alpha = -a; alpha <= a; ++alpha)
      for (int beta = -b; beta <= b; ++beta)
        if (std::abs(alpha + beta) <= J)
          complex_block((alpha + a) * (2 * b + 1) + beta + b, alpha + beta + J) =
              coupling(a, alpha, b, beta, J);
    const Eigen::MatrixXcd block = pair * complex_block * real_from_complex(J).adjoint();
    // Couplings with a + b + J odd come out imaginary: multiplying by i makes them real.
    const bool odd = (a + b + J) % 2 != 0;
    q.middleCols(column, 2 * J + 1) = odd ? Eigen::MatrixXd(-block.imag()) : Eigen::MatrixXd(block.real());
    column += 2 * J + 1;
  }
  return q;
}

}  // namespace

const Eigen::MatrixXd& clebsch_gordan(int a, int b) {
  constexpr int n = max_coupled_degree + 1;
  static const auto table = [] {
    std::array<Eigen::MatrixXd, n * n> all;
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) all[i * n + j] = compute(i, j);
    return all;
  }();
  return table[a * n + b];
}

Eigen::MatrixXd clebsch_gordan_block(int a, int b, int J) {
  const int low = std::abs(a - b);
  return clebsch_gordan(a, b).middleCols(J * J - low * low, 2 * J + 1);
}

}  // namespace bitr::irreps
