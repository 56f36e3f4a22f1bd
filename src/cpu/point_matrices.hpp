// The matrices of point_attention by name, on the paths of point_paths.hpp.
#pragma once

#include <array>
#include <cmath>
#include <utility>

#include "cpu/kernel.hpp"

namespace bitr::cpu {

/// In the order of ops::constants().
enum PointMatrix { M0, M1, O0, O1, S0, S1, Mz0, Mz1, Oz0, Oz1, plane, point_matrices };
/// M₁ and O₁ on the paths of VectorPaths; the rest as in the operation.
using PointMatrices = std::array<Eigen::MatrixXd, point_matrices>;
/// A row of coefficients.
constexpr PointMatrix per_cloud_matrices[] = {M0, O0, S0, Mz0, Oz0};

/// Degree-1 paths of ops/point_attention.hpp (rows) from those of VectorPaths (columns), for every head.
inline Eigen::MatrixXd path_basis(const ops::PointAttention& op) {
  const int n = op.n1(), c0 = op.c0, c1 = op.c1;
  Eigen::MatrixXd basis = Eigen::MatrixXd::Zero(op.heads * n, op.heads * n);
  for (int h = 0; h < op.heads; ++h) {
    auto one = basis.block(h * n, h * n, n, n);
    one.topLeftCorner(c0, c0).setIdentity();
    const auto couple = [&](int to, int from, double factor) {
      one.block(c0 + to * c1, c0 + from * c1, c1, c1).diagonal().setConstant(factor);
    };
    couple(0, 0, -1 / std::sqrt(3.0));
    couple(1, 1, 1 / std::sqrt(2.0));
    couple(2, 0, -1 / std::sqrt(6.0));
    couple(2, 2, 3 / std::sqrt(6.0));
  }
  return basis;
}

inline PointMatrices matrices_of(const ops::PointAttention& op) {
  PointMatrices all{op.M0, op.M1, op.O0, op.O1, op.S0, op.S1, op.Mz0, op.Mz1, op.Oz0, op.Oz1, op.plane};
  if (op.m1 == 0) return all;
  const Eigen::MatrixXd basis = path_basis(op);
  if (op.M1.size() > 0) all[M1] = basis.transpose() * op.M1;
  all[O1] = op.O1 * basis;
  return all;
}

/// The degree-0 matrices replaced by a row of coefficients.
template <class T>
PointMatrices with_coefficients(PointMatrices matrices, const ops::PointAttention& op, const T* row) {
  const int from = op.c0 + 1, paths = op.heads * op.n0();
  const std::pair<int, int> shapes[] = {
      {paths, from}, {op.m0, paths}, {op.m0, from}, {op.heads * from, from}, {op.m0, op.heads * from}};
  for (std::size_t i = 0; i < std::size(shapes); ++i) {
    const auto [rows, cols] = shapes[i];
    matrices[per_cloud_matrices[i]] = Eigen::Map<const RowMatrix<T>>(row, rows, cols).template cast<double>();
    row += rows * cols;
  }
  return matrices;
}

inline PointMatrices zeros_like(const PointMatrices& matrices) {
  PointMatrices zeros;
  for (int i = 0; i < point_matrices; ++i)
    zeros[i] = Eigen::MatrixXd::Zero(matrices[i].rows(), matrices[i].cols());
  return zeros;
}

/// From the gradient with respect to matrices_of(op) to that of the operation's own; those the operation does
/// not have stay out.
inline ops::PointAttention gradient_of(const ops::PointAttention& op, PointMatrices gradient) {
  if (op.m1 > 0) {
    const Eigen::MatrixXd basis = path_basis(op);
    if (op.M1.size() > 0) gradient[M1] = basis * gradient[M1];
    gradient[O1] = gradient[O1] * basis.transpose();
  }
  ops::PointAttention result = op;
  Eigen::MatrixXd* own[] = {&result.M0,  &result.M1,  &result.O0,  &result.O1,  &result.S0,   &result.S1,
                            &result.Mz0, &result.Mz1, &result.Oz0, &result.Oz1, &result.plane};
  for (int i = 0; i < point_matrices; ++i)
    if (own[i]->size() > 0) *own[i] = gradient[i];
  return result;
}

}  // namespace bitr::cpu
