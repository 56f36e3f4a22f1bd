// Builds ops::SectorTable: where along the quadrant's rays each LeakyReLU of a radial network changes sign,
// and the linear map between two such rays.
#include "ops/sector_table.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "model/fold_layers.hpp"
#include "model/fold_paths.hpp"

namespace bitr::model {
namespace {

using Eigen::ArrayXd;
using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

// Coefficients by ascending powers.
template <std::size_t N>
using Poly = std::array<double, N>;

constexpr double quarter_turn = std::numbers::pi / 2;

template <std::size_t N, std::size_t M>
Poly<N + M - 1> operator*(const Poly<N>& a, const Poly<M>& b) {
  Poly<N + M - 1> product{};
  for (std::size_t i = 0; i < N; ++i)
    for (std::size_t j = 0; j < M; ++j) product[i + j] += a[i] * b[j];
  return product;
}

template <std::size_t N>
Poly<N> operator-(Poly<N> a, const Poly<N>& b) {
  for (std::size_t i = 0; i < N; ++i) a[i] -= b[i];
  return a;
}

Vector2d ray(double angle) { return {std::cos(angle), std::sin(angle)}; }

// The polynomial Σ c_i tⁱ over t ∈ (0, ∞) as a Bézier curve: with t = s/(1 − s), (1 − s)ⁿ p(t) has the
// Bernstein coefficients c_i/(n over i) on s ∈ (0, 1). At most quartic.
class Bezier {
 public:
  template <std::size_t N>
  explicit Bezier(const Poly<N>& p) : degree_(static_cast<int>(N) - 1) {
    constexpr double binomial[5][5] = {{1}, {1, 1}, {1, 2, 1}, {1, 3, 3, 1}, {1, 4, 6, 4, 1}};
    for (int i = 0; i <= degree_; ++i) points_[i] = p[i] / binomial[degree_][i];
  }

  /// Values of s where the curve changes sign, in ascending order. Where it only touches 0 there may be some
  /// as well.
  template <class Found>
  void find_roots(Found found) const {
    find(points_, 0, 1, found);
  }

 private:
  using Points = std::array<double, 5>;
  static constexpr double resolution = 1e-9;  // roots nearer than this cannot be told apart

  // Descartes: as many roots as changes of sign among the coefficients, or an even number fewer.
  int sign_changes(const Points& points) const {
    int changes = 0;
    double last = 0;
    for (int i = 0; i <= degree_; ++i) {
      if (points[i] * last < 0) ++changes;
      if (points[i] != 0) last = points[i];
    }
    return changes;
  }
  // de Casteljau: the parts before and after s.
  void split(const Points& points, double s, Points& before, Points& after) const {
    after = points;
    for (int i = 0; i <= degree_; ++i) {
      before[i] = after[0];
      for (int j = 0; j < degree_ - i; ++j) after[j] += s * (after[j + 1] - after[j]);
    }
  }
  template <class Found>
  void find(const Points& points, double low, double high, Found& found) const {
    const int changes = sign_changes(points);
    if (changes == 0) return;
    if (changes == 1) return found(low + (high - low) * only_root(points));
    const double middle = (low + high) / 2;
    if (high - low < resolution) return found(middle);
    Points before, after;
    split(points, 0.5, before, after);
    find(before, low, middle, found);
    if (before[degree_] == 0) found(middle);
    find(after, middle, high, found);
  }
  // Newton's steps, kept inside the bracket by halving it.
  double only_root(const Points& points) const {
    double low = 0, high = 1, s = 0.5;
    const double sign = points[0] != 0 ? points[0] : -points[degree_];
    for (int step = 0; step < 100 && high - low > 1e-16; ++step) {
      Points before, after;
      split(points, s, before, after);
      const double value = after[0], slope = degree_ * (after[1] - after[0]) / (1 - s);
      if (value == 0) return s;
      (value * sign > 0 ? low : high) = s;
      const double next = s - value / slope;
      if (std::abs(next - s) < 1e-16) return s;
      s = next > low && next < high ? next : (low + high) / 2;
    }
    return s;
  }

  int degree_;
  Points points_{};
};

// A fan of rays u = a + t b, t ∈ (0, ∞), between the rays a and b: inside it, roots are positive roots.
class Fan {
 public:
  Fan(double low, double high) {
    ends_.col(0) = ray(low);
    ends_.col(1) = ray(high);
  }
  // Linear and quadratic forms as polynomials of u.
  Poly<2> linear(const Vector2d& w) const {
    const Vector2d local = ends_.transpose() * w;
    return {local[0], local[1]};
  }
  Poly<3> quadratic(const Matrix2d& m) const {
    const Matrix2d local = ends_.transpose() * m * ends_;
    return {local(0, 0), local(0, 1) + local(1, 0), local(1, 1)};
  }
  // Angles of the roots of p. One too many only splits a sector in two equal halves.
  template <std::size_t N>
  void add_roots(const Poly<N>& p, std::vector<double>& angles) const {
    Bezier(p).find_roots([&](double s) {
      const Vector2d u = ends_ * Vector2d(1 - s, s);
      angles.push_back(std::atan2(u[1], u[0]));
    });
  }

 private:
  Matrix2d ends_;
};

// Sorted, with the ends of the interval.
std::vector<double> with_ends(std::vector<double> angles, double low, double high) {
  angles.push_back(low);
  angles.push_back(high);
  std::sort(angles.begin(), angles.end());
  return angles;
}

// One sector's map, before the change of basis: R = slope · (…) + offset.
struct Sector {
  double end;       // angle
  ArrayXd pattern;  // slopes of both layers
  MatrixXd slope;   // n × 2 or n × 3
  VectorXd offset;  // n, or empty
  Matrix3d Q;
};

class Divider {
 public:
  explicit Divider(const ops::RadialNetwork& network) : net_(network) {}

  // Scale degree 1: h₁ = W₁ρ, h₂ = W₂D₁h₁, R = W₃D₂h₂.
  void divide_linear() {
    std::vector<double> first;
    const Fan quadrant(0, quarter_turn);
    for (Eigen::Index j = 0; j < net_.w1.rows(); ++j)
      quadrant.add_roots(quadrant.linear(net_.w1.row(j).transpose()), first);
    first = with_ends(std::move(first), 0, quarter_turn);
    for (std::size_t s = 0; s + 1 < first.size(); ++s) {
      const ArrayXd d1 = leaky_slopes(net_.w1 * ray((first[s] + first[s + 1]) / 2));
      const MatrixXd second = net_.w2 * d1.matrix().asDiagonal() * net_.w1;
      std::vector<double> inner;
      const Fan fan(first[s], first[s + 1]);
      for (Eigen::Index j = 0; j < second.rows(); ++j)
        fan.add_roots(fan.linear(second.row(j).transpose()), inner);
      inner = with_ends(std::move(inner), first[s], first[s + 1]);
      for (std::size_t i = 0; i + 1 < inner.size(); ++i) {
        const ArrayXd d2 = leaky_slopes(second * ray((inner[i] + inner[i + 1]) / 2));
        append({inner[i + 1],
                joined(d1, d2),
                net_.w3 * d2.matrix().asDiagonal() * second,
                {},
                Matrix3d::Zero()});
      }
    }
  }

  // Scale degree 0: (x, y) = ρ/√q(ρ), p = (x, y, 1), h₁ = G₁W₁(x, y) + b₁, h₂ = G₂A p/√Q(p) + b₂.
  void divide_normalised() {
    const MatrixXd w = net_.w1.rowwise() - net_.w1.colwise().mean();
    q = w.transpose() * w / static_cast<double>(w.rows());
    const MatrixXd first_map = net_.gain1.asDiagonal() * w;
    std::vector<double> first;
    const Fan quadrant(0, quarter_turn);
    for (Eigen::Index j = 0; j < w.rows(); ++j) {
      // g·(x, y) = −b means (g·u)² = b² q(u).
      const Vector2d g = first_map.row(j).transpose();
      if (negligible(net_.bias1[j], g))
        quadrant.add_roots(quadrant.linear(g), first);
      else
        quadrant.add_roots(quadrant.quadratic(g * g.transpose() - net_.bias1[j] * net_.bias1[j] * q), first);
    }
    first = with_ends(std::move(first), 0, quarter_turn);
    for (std::size_t s = 0; s + 1 < first.size(); ++s) {
      const Vector3d p = normalised((first[s] + first[s + 1]) / 2);
      const ArrayXd d1 = leaky_slopes(first_map * p.head<2>() + net_.bias1);
      MatrixXd affine(w.rows(), 3);
      affine << net_.w2 * d1.matrix().asDiagonal() * first_map,
          net_.w2 * (d1 * net_.bias1.array()).matrix() + net_.c2;
      affine = (affine.rowwise() - affine.colwise().mean()).eval();
      divide_second(affine, d1, first[s], first[s + 1]);
    }
  }

  Matrix2d q = Matrix2d::Zero();
  std::vector<Sector> sectors;

 private:
  Vector3d normalised(double angle) const {
    const Vector2d u = ray(angle);
    const double variance = u.dot(q * u);
    return {u[0] / std::sqrt(variance), u[1] / std::sqrt(variance), 1};
  }

  // Squares of what crosses zero only touch it: where a bias (0 in new models) leaves nothing else, the
  // equation is taken as it is.
  template <class Vector>
  static bool negligible(double bias, const Vector& g) {
    return std::abs(bias) <= 1e-7 * g.norm();
  }
  // g·p = 0, which is g₁₂·u = −g₃√q(u).
  static void add_plane_roots(const Fan& fan, const Vector3d& g, const Poly<3>& variance,
                              std::vector<double>& angles) {
    const Poly<2> line = fan.linear(g.head<2>());
    if (negligible(g[2], g.head<2>()))
      fan.add_roots(line, angles);
    else
      fan.add_roots(line * line - Poly<1>{g[2] * g[2]} * variance, angles);
  }

  void divide_second(const MatrixXd& affine, const ArrayXd& d1, double low, double high) {
    const Matrix3d Q = affine.transpose() * affine / static_cast<double>(affine.rows());
    std::vector<double> inner;
    const Fan fan(low, high);
    const Poly<3> variance = fan.quadratic(q);
    for (Eigen::Index j = 0; j < affine.rows(); ++j) {
      // g·p = −b√Q(p) means S(p) = (g·p)² − b²Q(p) = 0; with p ∝ (u, √q(u)), S = α(u) + β(u)√q(u).
      const Vector3d g = net_.gain2[j] * affine.row(j).transpose();
      if (negligible(net_.bias2[j], g)) {
        add_plane_roots(fan, g, variance, inner);
        continue;
      }
      const Matrix3d S = g * g.transpose() - net_.bias2[j] * net_.bias2[j] * Q;
      const Poly<3> alpha = fan.quadratic(S.topLeftCorner<2, 2>() + S(2, 2) * q);
      const Poly<2> beta = fan.linear(2 * S.topRightCorner<2, 1>());
      fan.add_roots(alpha * alpha - beta * beta * variance, inner);
    }
    inner = with_ends(std::move(inner), low, high);
    for (std::size_t i = 0; i + 1 < inner.size(); ++i) {
      const Vector3d p = normalised((inner[i] + inner[i + 1]) / 2);
      const VectorXd h = net_.gain2.asDiagonal() * affine * p / std::sqrt(p.dot(Q * p)) + net_.bias2;
      const ArrayXd d2 = leaky_slopes(h);
      append({inner[i + 1], joined(d1, d2),
              net_.w3 * (d2 * net_.gain2.array()).matrix().asDiagonal() * affine,
              net_.w3 * (d2 * net_.bias2.array()).matrix() + net_.c3, Q});
    }
  }

  static ArrayXd joined(const ArrayXd& a, const ArrayXd& b) {
    ArrayXd both(a.size() + b.size());
    both << a, b;
    return both;
  }

  void append(Sector sector) {
    if (!sectors.empty() && (sectors.back().pattern == sector.pattern).all())
      sectors.back().end = sector.end;
    else
      sectors.push_back(std::move(sector));
  }

  const ops::RadialNetwork& net_;
};

// Rows (c_out, c_in, freq) of the network to (freq', c_out, c_in) of the coefficients.
MatrixXd reorder(const MatrixXd& rows, const MatrixXd& basis, int channels, double scale) {
  const auto freq = basis.cols();
  MatrixXd out = MatrixXd::Zero(rows.rows(), rows.cols());
  for (Eigen::Index target = 0; target < freq; ++target)
    for (Eigen::Index c = 0; c < channels; ++c)
      for (Eigen::Index f = 0; f < freq; ++f)
        out.row(target * channels + c) += scale * basis(target, f) * rows.row(c * freq + f);
  return out;
}

}  // namespace

ops::SectorTable sector_table(const std::shared_ptr<const ops::RadialNetwork>& network, const MatrixXd& basis,
                              int in_channels, int out_channels, double scale) {
  ops::SectorTable table;
  table.scale_degree = network->scale_degree;
  table.network = network;
  table.basis = basis;
  table.scale = scale;
  const int channels = in_channels * out_channels;
  table.size = static_cast<int>(basis.rows()) * channels;

  Divider divider(*network);
  if (network->scale_degree == 1)
    divider.divide_linear();
  else
    divider.divide_normalised();
  table.q = {divider.q(0, 0), 2 * divider.q(0, 1), divider.q(1, 1)};
  for (const Sector& sector : divider.sectors) {
    table.slope.push_back(reorder(sector.slope, basis, channels, scale));
    if (network->scale_degree == 0) {
      table.offset.push_back(reorder(sector.offset, basis, channels, scale));
      const Matrix3d& Q = sector.Q;
      table.Q.push_back({Q(0, 0), 2 * Q(0, 1), Q(1, 1), 2 * Q(0, 2), 2 * Q(1, 2), Q(2, 2)});
    }
    if (&sector != &divider.sectors.back())
      table.rays.push_back({std::cos(sector.end), std::sin(sector.end)});
  }
  return table;
}

}  // namespace bitr::model
