// One-sided layers: ops/point_attention.hpp, ops/mean_direction.hpp, ops/cloud_coefficients.hpp.
#include <cmath>

#include "model/fold_layers.hpp"
#include "model/fold_paths.hpp"

namespace bitr::model {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using irreps::Degree;

constexpr Degree scalar{0, 0}, vector{1, 0};

// Matrix blocks [h] of a product over the channels of head h: left's columns, right's rows.
MatrixXd per_head_columns(const MatrixXd& left, const MatrixXd& right, int heads) {
  const auto n = right.rows() / heads;
  MatrixXd all(left.rows(), heads * right.cols());
  for (int h = 0; h < heads; ++h)
    all.middleCols(h * right.cols(), right.cols()) = left.middleCols(h * n, n) * right.middleRows(h * n, n);
  return all;
}

// Rows (h, path): Σ over the keys of head h of key-from-path ⊗ query-from-feature.
MatrixXd per_head_queries(const MatrixXd& keys, const MatrixXd& query, int heads) {
  const auto n = keys.rows() / heads;
  MatrixXd all(heads * keys.cols(), query.cols());
  for (int h = 0; h < heads; ++h)
    all.middleRows(h * keys.cols(), keys.cols()) =
        keys.middleRows(h * n, n).transpose() * query.middleRows(h * n, n);
  return all;
}

MatrixXd append_zero_column(const MatrixXd& matrix) {
  MatrixXd wider = MatrixXd::Zero(matrix.rows(), matrix.cols() + 1);
  wider.leftCols(matrix.cols()) = matrix;
  return wider;
}

}  // namespace

Eigen::ArrayXd leaky_slopes(const VectorXd& x) {
  return (x.array() > 0)
      .select(Eigen::ArrayXd::Ones(x.size()), Eigen::ArrayXd::Constant(x.size(), ops::leaky_slope));
}

VectorXd leaky(const VectorXd& x) { return (x.array() > 0).select(x.array(), ops::leaky_slope * x.array()); }

VectorXd layer_norm(const VectorXd& x, const VectorXd& gain, const VectorXd& bias, double eps) {
  const Eigen::ArrayXd centred = x.array() - x.mean();
  const double variance = centred.square().mean() + eps;
  const double scale = variance > 0 ? 1 / std::sqrt(variance) : 0;
  return centred * scale * gain.array() + bias.array();
}

PathMatrices path_matrices(const ops::Convolve& convolve) {
  const int c0 = convolve.fiber_in.channels(scalar), c1 = convolve.fiber_in.channels(vector);
  const int rows0 = convolve.fiber_out.channels(scalar), rows1 = convolve.fiber_out.channels(vector);
  PathMatrices paths{{MatrixXd::Zero(rows0, c0 + c1), MatrixXd::Zero(rows0, c0 + 1)},
                     {MatrixXd::Zero(rows1, c0 + 3 * c1), MatrixXd::Zero(rows1, c1)}};
  for (const ops::RadialBlock& block : convolve.blocks) {
    const VectorXd edge = constant_radial(*block.network, false),
                   zero = constant_radial(*block.network, true);
    PathMatrix& target = block.out == scalar ? paths.degree0 : paths.degree1;
    for_each_path(block, convolve.fiber_in, [&](const PathEntry& at) {
      target.edge(at.row, at.column) = edge[at.radial];
      if (at.zero_factor != 0) target.zero(at.row, at.zero_column) = at.zero_factor * zero[at.radial];
    });
  }
  return paths;
}

MatrixXd with_skip(const ops::Linear& linear, Degree d) {
  const auto it = linear.weights.find(d);
  if (it == linear.weights.end()) return {};
  return linear.skip.count(d)
             ? MatrixXd(it->second + MatrixXd::Identity(it->second.rows(), it->second.cols()))
             : it->second;
}

VectorXd constant_radial(const ops::RadialNetwork& network, bool zero_length) {
  VectorXd hidden =
      zero_length ? network.bias1 : layer_norm(network.w1.col(0), network.gain1, network.bias1, 0);
  hidden = network.w2 * leaky(hidden) + network.c2;
  hidden = layer_norm(hidden, network.gain2, network.bias2, network.eps);
  return network.w3 * leaky(hidden) + network.c3;
}

ops::PointAttention point_attention(const ops::AttentionLayer& layer, const ops::ProjectedRelu* relu) {
  ops::PointAttention op;
  op.c0 = layer.fiber_in.channels(scalar);
  op.c1 = layer.fiber_in.channels(vector);
  op.m0 = layer.fiber_out.channels(scalar);
  op.m1 = layer.fiber_out.channels(vector);
  op.uniform = layer.zero_centre;
  op.heads = op.uniform ? 1 : layer.heads;

  const PathMatrices paths = path_matrices(layer.values_keys);
  const double logit_scale = 1 / std::sqrt(layer.key_fiber.component_count());
  const auto fold_degree = [&](Degree d, const PathMatrix& path, MatrixXd& M, MatrixXd& Mz, MatrixXd& O,
                               MatrixXd& Oz, MatrixXd& S) {
    const int values = layer.value_fiber.channels(d), keys = layer.key_fiber.channels(d);
    const MatrixXd project = with_skip(layer.project, d);
    O = per_head_columns(project.leftCols(values), path.edge.topRows(values), op.heads);
    Oz = per_head_columns(project.leftCols(values), path.zero.topRows(values), op.heads);
    if (op.uniform) return;
    S = project.rightCols(project.cols() - values);
    const MatrixXd query = with_skip(layer.query, d) * logit_scale;
    if (keys == 0) return;
    M = per_head_queries(path.edge.bottomRows(keys), query, op.heads);
    Mz = per_head_queries(path.zero.bottomRows(keys), query, op.heads);
  };
  fold_degree(scalar, paths.degree0, op.M0, op.Mz0, op.O0, op.Oz0, op.S0);
  if (op.m1 > 0) fold_degree(vector, paths.degree1, op.M1, op.Mz1, op.O1, op.Oz1, op.S1);
  if (!op.uniform) {
    op.M0 = append_zero_column(op.M0);
    op.Mz0 = append_zero_column(op.Mz0);
    op.S0 = append_zero_column(op.S0);
  }
  if (relu) {
    op.relu = true;
    op.plane = relu->planes.at(vector);
    op.relu_square = relu->square;
  }
  return op;
}

ops::MeanDirection mean_direction(const ops::PointAttention& first, double constant) {
  ops::MeanDirection op;
  op.general = first;
  op.constant = constant;
  op.scalars = first.S0.col(0) * constant + first.S0.col(1);
  op.slopes = VectorXd::Zero(first.m1);
  for (int h = 0; h < first.heads; ++h) {
    op.scalars += first.O0.col(h) * constant;
    op.slopes += first.O1.col(h) * constant;
  }
  if (first.relu) op.scalars = leaky(op.scalars);
  return op;
}

ops::CloudCoefficients cloud_coefficients(const ops::PointAttention& full,
                                          const ops::ExtendFeatures& extend) {
  ops::CloudCoefficients op{full, {}};
  op.layer.c0 = extend.fiber.channels(scalar);
  op.layer.c1 = extend.fiber.channels(vector);
  op.layer.m0 = full.m0;
  op.layer.heads = full.heads;
  op.layer.direction = true;
  op.layer.per_cloud = true;
  return op;
}

}  // namespace bitr::model
