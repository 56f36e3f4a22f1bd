// sector_table.cpp backwards: what a network's sectors say about its weights. Inside a sector the activation
// pattern is fixed, so that slope, offset, Q and q are products of the weights.
#include <cmath>
#include <numbers>

#include "model/fold_gradient.hpp"
#include "model/fold_paths.hpp"

namespace bitr::model {
namespace {

using Eigen::ArrayXd;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

// A direction in the middle of sector s.
Vector2d middle_of(const ops::SectorTable& table, std::size_t s) {
  const auto angle = [&](std::size_t ray) { return std::atan2(table.rays[ray][1], table.rays[ray][0]); };
  const double low = s == 0 ? 0 : angle(s - 1),
               high = s == table.rays.size() ? std::numbers::pi / 2 : angle(s);
  return {std::cos((low + high) / 2), std::sin((low + high) / 2)};
}

// From the gradient of (freq', c_out, c_in) coefficients to that of the network's rows (c_out, c_in, freq).
MatrixXd network_rows(const ops::SectorTable& table, const MatrixXd& coefficients, int channels) {
  const auto freq = table.basis.cols();
  MatrixXd rows = MatrixXd::Zero(coefficients.rows(), coefficients.cols());
  for (Eigen::Index target = 0; target < freq; ++target)
    for (Eigen::Index c = 0; c < channels; ++c)
      for (Eigen::Index f = 0; f < freq; ++f)
        if (const double factor = table.scale * table.basis(target, f); factor != 0)
          rows.row(c * freq + f) += factor * coefficients.row(target * channels + c);
  return rows;
}

// d of the columns of `a` from the gradients of the numbers aᵢ·aⱼ/rows (twice that where i ≠ j): forms are
// stored by (0,0), 2(0,1), (1,1), and for three columns 2(0,2), 2(1,2), (2,2).
template <std::size_t N>
MatrixXd form_gradient(const MatrixXd& a, const std::array<double, N>& d) {
  MatrixXd symmetric(a.cols(), a.cols());
  if constexpr (N == 3)
    symmetric << d[0], d[1], d[1], d[2];
  else
    symmetric << d[0], d[1], d[3], d[1], d[2], d[4], d[3], d[4], d[5];
  return 2 / static_cast<double>(a.rows()) * a * symmetric;
}

bool is_zero(const ops::SectorTable& gradient, std::size_t s) {
  return gradient.slope[s].isZero(0) &&
         (gradient.scale_degree == 1 ||
          (gradient.offset[s].isZero(0) && gradient.Q[s] == std::array<double, 6>{}));
}

void add_linear(const ops::SectorTable& table, const ops::SectorTable& gradient, int channels,
                ops::RadialNetwork& to) {
  const ops::RadialNetwork& net = *table.network;
  for (std::size_t s = 0; s < table.sectors(); ++s) {
    if (is_zero(gradient, s)) continue;
    const VectorXd h1 = net.w1 * middle_of(table, s);
    const ArrayXd d1 = leaky_slopes(h1);
    const MatrixXd first = d1.matrix().asDiagonal() * net.w1;
    const ArrayXd d2 = leaky_slopes(net.w2 * (d1 * h1.array()).matrix());
    const MatrixXd rows = network_rows(table, gradient.slope[s], channels);
    to.w3 += rows * (d2.matrix().asDiagonal() * (net.w2 * first)).transpose();
    const MatrixXd second = d2.matrix().asDiagonal() * (net.w3.transpose() * rows);
    to.w2 += second * first.transpose();
    to.w1 += d1.matrix().asDiagonal() * (net.w2.transpose() * second);
  }
}

void add_normalised(const ops::SectorTable& table, const ops::SectorTable& gradient, int channels,
                    ops::RadialNetwork& to) {
  const ops::RadialNetwork& net = *table.network;
  const MatrixXd w = net.w1.rowwise() - net.w1.colwise().mean();
  const MatrixXd first_map = net.gain1.asDiagonal() * w;
  MatrixXd d_first = MatrixXd::Zero(w.rows(), 2);
  for (std::size_t s = 0; s < table.sectors(); ++s) {
    if (is_zero(gradient, s)) continue;
    const Vector2d u = middle_of(table, s);
    const double variance = (w * u).squaredNorm() / static_cast<double>(w.rows());
    const Vector3d p(u[0] / std::sqrt(variance), u[1] / std::sqrt(variance), 1);
    const ArrayXd d1 = leaky_slopes(first_map * p.head<2>() + net.bias1);
    MatrixXd first(w.rows(), 3);
    first << d1.matrix().asDiagonal() * first_map, (d1 * net.bias1.array()).matrix();
    MatrixXd affine = net.w2 * first;
    affine.col(2) += net.c2;
    affine = (affine.rowwise() - affine.colwise().mean()).eval();
    const VectorXd h2 = net.gain2.asDiagonal() * affine * p /
                            std::sqrt((affine * p).squaredNorm() / static_cast<double>(w.rows())) +
                        net.bias2;
    const ArrayXd d2 = leaky_slopes(h2), scaled = d2 * net.gain2.array();

    const MatrixXd rows = network_rows(table, gradient.slope[s], channels);
    const VectorXd constant = network_rows(table, gradient.offset[s], channels);
    to.w3 += rows * (scaled.matrix().asDiagonal() * affine).transpose() +
             constant * (d2 * net.bias2.array()).matrix().transpose();
    to.c3 += constant;
    const MatrixXd back = net.w3.transpose() * rows;
    to.gain2 += (d2 * (back.array() * affine.array()).rowwise().sum()).matrix();
    to.bias2 += (d2 * (net.w3.transpose() * constant).array()).matrix();
    MatrixXd d_affine = scaled.matrix().asDiagonal() * back + form_gradient(affine, gradient.Q[s]);
    d_affine = (d_affine.rowwise() - d_affine.colwise().mean()).eval();
    to.w2 += d_affine * first.transpose();
    to.c2 += d_affine.col(2);
    const MatrixXd d_hidden = d1.matrix().asDiagonal() * (net.w2.transpose() * d_affine);
    d_first += d_hidden.leftCols<2>();
    to.bias1 += d_hidden.col(2);
  }
  to.gain1 += (d_first.array() * w.array()).rowwise().sum().matrix();
  MatrixXd d_w = net.gain1.asDiagonal() * d_first + form_gradient(w, gradient.q);
  to.w1 += d_w.rowwise() - d_w.colwise().mean();
}

}  // namespace

void add_sector_table_gradient(const ops::SectorTable& table, const ops::SectorTable& gradient, int channels,
                               ops::RadialNetwork& to) {
  if (table.scale_degree == 1)
    add_linear(table, gradient, channels, to);
  else
    add_normalised(table, gradient, channels, to);
}

}  // namespace bitr::model
