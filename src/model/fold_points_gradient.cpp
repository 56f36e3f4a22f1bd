// One-sided layers: fold_points.cpp backwards.
#include <cmath>

#include "model/fold_gradient.hpp"
#include "model/fold_layers.hpp"
#include "model/fold_paths.hpp"

namespace bitr::model {
namespace {

using Eigen::ArrayXd;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using irreps::Degree;

ops::RadialNetwork& network_of(ops::RadialBlock& block) {
  return const_cast<ops::RadialNetwork&>(*block.network);
}

// d of layer_norm(x, gain, bias, eps), given its d; adds to those of gain and bias.
VectorXd layer_norm_gradient(const VectorXd& x, const VectorXd& gain, double eps, const VectorXd& d,
                             VectorXd& d_gain, VectorXd& d_bias) {
  const ArrayXd centred = x.array() - x.mean();
  const double variance = centred.square().mean() + eps;
  const double scale = variance > 0 ? 1 / std::sqrt(variance) : 0;
  const ArrayXd normed = centred * scale, inner = d.array() * gain.array();
  d_gain += (d.array() * normed).matrix();
  d_bias += d;
  return scale * (inner - inner.mean() - normed * (inner * normed).mean()).matrix();
}

VectorXd leaky_gradient(const VectorXd& x, const VectorXd& d) {
  return (x.array() > 0).select(d.array(), ops::leaky_slope * d.array());
}

// Adds to the gradients of project and query; returns those of the path matrices.
PathMatrix degree_gradient(const ops::AttentionLayer& layer, Degree d, const PathMatrix& paths, int heads,
                           bool uniform, const MatrixXd& dM, const MatrixXd& dMz, const MatrixXd& dO,
                           const MatrixXd& dOz, const MatrixXd& dS, ops::AttentionLayer& to) {
  const int values = layer.value_fiber.channels(d), keys = layer.key_fiber.channels(d);
  const MatrixXd project = with_skip(layer.project, d);
  MatrixXd& d_project = to.project.weights.at(d);
  PathMatrix result{MatrixXd::Zero(paths.edge.rows(), paths.edge.cols()),
                    MatrixXd::Zero(paths.zero.rows(), paths.zero.cols())};
  const auto values_of = [&](const MatrixXd& path, const MatrixXd& d_out, MatrixXd& d_path) {
    const Eigen::Index n = values / heads, width = path.cols();
    for (int h = 0; h < heads; ++h) {
      const auto part = d_out.middleCols(h * width, width);
      d_project.middleCols(h * n, n) += part * path.middleRows(h * n, n).transpose();
      d_path.middleRows(h * n, n) += project.middleCols(h * n, n).transpose() * part;
    }
  };
  values_of(paths.edge, dO, result.edge);
  values_of(paths.zero, dOz, result.zero);
  if (uniform) return result;
  const auto own = project.cols() - values;
  d_project.rightCols(own) += dS.leftCols(own);
  if (keys == 0) return result;

  const double scale = 1 / std::sqrt(layer.key_fiber.component_count());
  const MatrixXd query = with_skip(layer.query, d) * scale;
  MatrixXd& d_query = to.query.weights.at(d);
  const auto keys_of = [&](const MatrixXd& path, const MatrixXd& d_out, MatrixXd& d_path) {
    const Eigen::Index n = keys / heads, width = path.cols();
    for (int h = 0; h < heads; ++h) {
      const auto part = d_out.middleRows(h * width, width).leftCols(query.cols());
      const auto key = path.middleRows(values + h * n, n);
      d_path.middleRows(values + h * n, n) += query.middleRows(h * n, n) * part.transpose();
      d_query.middleRows(h * n, n) += scale * (key * part);
    }
  };
  keys_of(paths.edge, dM, result.edge);
  keys_of(paths.zero, dMz, result.zero);
  return result;
}

}  // namespace

void add_constant_radial_gradient(const ops::RadialNetwork& network, bool zero_length,
                                  const VectorXd& gradient, ops::RadialNetwork& to) {
  const VectorXd first = network.w1.col(0);
  const VectorXd h1 = zero_length ? network.bias1 : layer_norm(first, network.gain1, network.bias1, 0);
  const VectorXd a1 = leaky(h1);
  const VectorXd p2 = network.w2 * a1 + network.c2;
  const VectorXd h2 = layer_norm(p2, network.gain2, network.bias2, network.eps);

  to.w3 += gradient * leaky(h2).transpose();
  to.c3 += gradient;
  const VectorXd d_h2 = leaky_gradient(h2, network.w3.transpose() * gradient);
  const VectorXd d_p2 = layer_norm_gradient(p2, network.gain2, network.eps, d_h2, to.gain2, to.bias2);
  to.w2 += d_p2 * a1.transpose();
  to.c2 += d_p2;
  const VectorXd d_h1 = leaky_gradient(h1, network.w2.transpose() * d_p2);
  if (zero_length)
    to.bias1 += d_h1;
  else
    to.w1.col(0) += layer_norm_gradient(first, network.gain1, 0, d_h1, to.gain1, to.bias1);
}

void add_point_attention_gradient(const ops::AttentionLayer& layer, const ops::PointAttention& gradient,
                                  ops::AttentionLayer& to) {
  const PathMatrices paths = path_matrices(layer.values_keys);
  constexpr Degree scalar{0, 0}, vector{1, 0};
  const PathMatrix scalars =
      degree_gradient(layer, scalar, paths.degree0, gradient.heads, gradient.uniform, gradient.M0,
                      gradient.Mz0, gradient.O0, gradient.Oz0, gradient.S0, to);
  PathMatrix vectors;
  if (gradient.m1 > 0)
    vectors = degree_gradient(layer, vector, paths.degree1, gradient.heads, gradient.uniform, gradient.M1,
                              gradient.Mz1, gradient.O1, gradient.Oz1, gradient.S1, to);
  for (std::size_t b = 0; b < layer.values_keys.blocks.size(); ++b) {
    const ops::RadialBlock& block = layer.values_keys.blocks[b];
    const PathMatrix& from = block.out == scalar ? scalars : vectors;
    VectorXd edge = VectorXd::Zero(block.out_channels * block.in_channels * block.freq()), zero = edge;
    for_each_path(block, layer.fiber_in, [&](const PathEntry& at) {
      edge[at.radial] += from.edge(at.row, at.column);
      if (at.zero_factor != 0) zero[at.radial] += at.zero_factor * from.zero(at.row, at.zero_column);
    });
    ops::RadialNetwork& network = network_of(to.values_keys.blocks[b]);
    add_constant_radial_gradient(*block.network, false, edge, network);
    if (!zero.isZero(0)) add_constant_radial_gradient(*block.network, true, zero, network);
  }
}

}  // namespace bitr::model
