#include <cmath>

#include "cpu/constant_gradient.hpp"

namespace bitr::cpu {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using RowMatrixXd = RowMatrix<double>;

constexpr int to_xyz[3] = {2, 0, 1};

enum : int { positions_input, features_input };
enum : int { normed_output, logits_output, weights_output, pieces_output };

template <class T>
class HeadGradient : public Kernel<T> {
 public:
  explicit HeadGradient(const ops::Gradient<ops::Head>& op) : op_(op) {}

  void run(const Arguments& args) const override {
    const GradientSlots<ops::Head> slots{op_, args};
    ops::Head constants = ops::zeros_like(op_.op);
    for (std::uint32_t pair = 0; pair < args.layout.pairs(); ++pair) run_pair(slots, pair, constants);
    store_constants<T>(slots.constants(), constants);
  }

 private:
  static auto rows_of(const GradientSlots<ops::Head>& slots, const Slot& slot, std::uint32_t pair) {
    const auto keys = static_cast<Eigen::Index>(slots.args.layout.key_points);
    return Eigen::Map<RowMatrix<T>>(slot.as<T>() + pair * keys * slot.width, keys, slot.width);
  }
  static RowMatrixXd load(const GradientSlots<ops::Head>& slots, const Slot& slot, std::uint32_t pair) {
    return rows_of(slots, slot, pair).template cast<double>();
  }
  // The gradient of an output's rows; zero where there is none.
  static MatrixXd grad_output(const GradientSlots<ops::Head>& slots, int output, std::uint32_t pair) {
    if (const Slot* slot = slots.grad_output(output)) return load(slots, *slot, pair);
    return MatrixXd::Zero(slots.args.layout.key_points, slots.out(output).width);
  }

  void run_pair(const GradientSlots<ops::Head>& slots, std::uint32_t pair, ops::Head& constants) const {
    const RowMatrixXd positions = load(slots, slots.in(positions_input), pair),
                      features = load(slots, slots.in(features_input), pair);
    const MatrixXd weights = load(slots, slots.out(weights_output), pair);
    RowMatrixXd d_positions = RowMatrixXd::Zero(positions.rows(), positions.cols()),
                d_features = RowMatrixXd::Zero(features.rows(), features.cols());
    MatrixXd d_weights = grad_output(slots, weights_output, pair);

    if (const Slot* slot = slots.grad_output(pieces_output)) {
      const Eigen::Matrix<double, ops::piece_count, 1> piece =
          Eigen::Map<const Eigen::Matrix<T, ops::piece_count, 1>>(slot->as<T>() + pair * ops::piece_count)
              .template cast<double>();
      Eigen::Matrix<double, 9, 1> r;
      Eigen::Vector3d a, b;
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) r[3 * to_xyz[i] + to_xyz[j]] = piece[3 * i + j];
        a[to_xyz[i]] = piece[15 + i];
        b[to_xyz[i]] = piece[18 + i];
      }
      const auto reduce = [&](irreps::Degree d, int column, const Eigen::RowVectorXd& mix,
                              const VectorXd& out, Eigen::RowVectorXd& d_mix) {
        reduce_gradient(features, d, weights.col(column), mix, out, d_features, d_weights, column, d_mix);
      };
      reduce({1, 1}, 0, op_.op.matrix_mix, r, constants.matrix_mix);
      reduce({1, 0}, 1, op_.op.vector_mix, a, constants.vector_mix);
      reduce({0, 1}, 1, op_.op.vector_mix, b, constants.vector_mix);
      d_positions = weights.col(2) * piece.segment<6>(9).transpose();
      d_weights.col(2) += positions * piece.segment<6>(9);
    }

    const Eigen::RowVectorXd mean = weights.cwiseProduct(d_weights).colwise().sum();
    const MatrixXd d_logits =
        weights.cwiseProduct(d_weights.rowwise() - mean) + grad_output(slots, logits_output, pair);
    const int scalars = op_.op.fiber.channels({0, 0});
    const MatrixXd normed = graph_norm(features.leftCols(scalars));
    constants.logit_weight += d_logits.transpose() * normed;
    constants.logit_bias += d_logits.colwise().sum().transpose();
    const MatrixXd d_normed = d_logits * op_.op.logit_weight + grad_output(slots, normed_output, pair);
    d_features.leftCols(scalars) += norm_gradient(features.leftCols(scalars), d_normed, constants);

    if (const Slot* to = slots.grad_input(positions_input))
      rows_of(slots, *to, pair) = d_positions.template cast<T>();
    if (const Slot* to = slots.grad_input(features_input))
      rows_of(slots, *to, pair) = d_features.template cast<T>();
  }

  // Differentiates out = mix · Σ weight F of one degree.
  void reduce_gradient(const RowMatrixXd& features, irreps::Degree d, const VectorXd& weight,
                       const Eigen::RowVectorXd& mix, const VectorXd& d_out, RowMatrixXd& d_features,
                       MatrixXd& d_weights, int column, Eigen::RowVectorXd& d_mix) const {
    const int channels = op_.op.fiber.channels(d), begin = op_.op.fiber.offset(d), size = channels * d.dim();
    const RowMatrixXd each = mix.transpose() * d_out.transpose();
    const Eigen::Map<const VectorXd> flat(each.data(), size);
    d_features.middleCols(begin, size) += weight * flat.transpose();
    d_weights.col(column) += features.middleCols(begin, size) * flat;
    const VectorXd pooled = features.middleCols(begin, size).transpose() * weight;
    d_mix += (Eigen::Map<const RowMatrixXd>(pooled.data(), channels, d.dim()) * d_out).transpose();
  }

  struct Norm {
    Norm(const ops::Head& op, const MatrixXd& x, Eigen::Index c)
        : mean(x.col(c).mean()), sub(x.col(c).array() - mean * op.mean_scale[c]) {
      const double variance = sub.square().mean() + op.eps;
      scale = variance > 0 ? 1 / std::sqrt(variance) : 0;
    }
    double mean, scale;
    Eigen::ArrayXd sub;
  };

  // In double, where the forward pass has stored it in T.
  MatrixXd graph_norm(const MatrixXd& x) const {
    MatrixXd out(x.rows(), x.cols());
    for (Eigen::Index c = 0; c < x.cols(); ++c) {
      const Norm norm(op_.op, x, c);
      out.col(c) = norm.sub * (norm.scale * op_.op.norm_weight[c]) + op_.op.norm_bias[c];
    }
    return out;
  }

  MatrixXd norm_gradient(const MatrixXd& x, const MatrixXd& d_out, ops::Head& constants) const {
    MatrixXd d_x(x.rows(), x.cols());
    const auto count = static_cast<double>(x.rows());
    for (Eigen::Index c = 0; c < x.cols(); ++c) {
      const Norm norm(op_.op, x, c);
      const Eigen::ArrayXd out = d_out.col(c).array();
      constants.norm_weight[c] += (out * norm.sub).sum() * norm.scale;
      constants.norm_bias[c] += out.sum();
      const Eigen::ArrayXd scaled = out * (op_.op.norm_weight[c] * norm.scale);
      const Eigen::ArrayXd sub =
          scaled - norm.sub * ((scaled * norm.sub).sum() * norm.scale * norm.scale / count);
      constants.mean_scale[c] -= sub.sum() * norm.mean;
      d_x.col(c) = sub - sub.sum() * op_.op.mean_scale[c] / count;
    }
    return d_x;
  }

  const ops::Gradient<ops::Head> op_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::Gradient<ops::Head>& op) {
  return std::make_unique<HeadGradient<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::Gradient<ops::Head>& op) {
  return std::make_unique<HeadGradient<double>>(op);
}

}  // namespace bitr::cpu
