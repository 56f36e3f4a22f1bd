#include <cmath>

#include "cpu/kernel.hpp"

namespace bitr::cpu {
namespace {

using Eigen::MatrixXd;
using RowMatrixXd = RowMatrix<double>;

// Columns of each point of the feature's (y, z, x) order in (x, y, z).
constexpr int to_xyz[3] = {2, 0, 1};

template <class T>
class HeadKernel : public Kernel<T> {
 public:
  explicit HeadKernel(const ops::Head& op) : op_(op) {}

  void run(const Arguments& args) const override {
    const std::size_t keys = args.layout.key_points;
    for (std::size_t pair = 0; pair < args.layout.pairs(); ++pair) {
      const auto load = [&](const Slot& slot) {
        return RowMatrixXd(
            Eigen::Map<const RowMatrix<T>>(slot.as<T>() + pair * keys * slot.stride(), keys, slot.width)
                .template cast<double>());
      };
      const auto store = [&](const Slot& slot, const MatrixXd& rows) {
        Eigen::Map<RowMatrix<T>>(slot.as<T>() + pair * keys * slot.stride(), keys, slot.width) =
            rows.cast<T>();
      };
      const RowMatrixXd positions = load(args.in[0]), features = load(args.in[1]);
      const MatrixXd normed = graph_norm(features.leftCols(op_.fiber.channels({0, 0})));
      const MatrixXd logits = (normed * op_.logit_weight.transpose()).rowwise() + op_.logit_bias.transpose();
      MatrixXd weights = (logits.rowwise() - logits.colwise().maxCoeff()).array().exp();
      weights.array().rowwise() /= weights.colwise().sum().array().eval();
      store(args.out[0], normed);
      store(args.out[1], logits);
      store(args.out[2], weights);
      Eigen::Map<Eigen::Matrix<T, ops::piece_count, 1>>(args.out[3].as<T>() + pair * ops::piece_count) =
          pieces(positions, features, weights).template cast<T>();
    }
  }

 private:
  MatrixXd graph_norm(const MatrixXd& x) const {
    MatrixXd out(x.rows(), x.cols());
    for (Eigen::Index c = 0; c < x.cols(); ++c) {
      const Eigen::ArrayXd sub = x.col(c).array() - x.col(c).mean() * op_.mean_scale[c];
      const double variance = sub.square().mean() + op_.eps;
      const double scale = variance > 0 ? op_.norm_weight[c] / std::sqrt(variance) : 0;
      out.col(c) = sub * scale + op_.norm_bias[c];
    }
    return out;
  }

  // One channel of a degree: Σ over key points and channels.
  Eigen::VectorXd reduce(const RowMatrixXd& features, irreps::Degree d, const Eigen::VectorXd& weight,
                         const Eigen::RowVectorXd& mix) const {
    const Eigen::VectorXd pooled =
        features.middleCols(op_.fiber.offset(d), op_.fiber.channels(d) * d.dim()).transpose() * weight;
    return (mix * Eigen::Map<const RowMatrixXd>(pooled.data(), op_.fiber.channels(d), d.dim())).transpose();
  }

  Eigen::Matrix<double, ops::piece_count, 1> pieces(const RowMatrixXd& positions, const RowMatrixXd& features,
                                                    const MatrixXd& weights) const {
    Eigen::Matrix<double, ops::piece_count, 1> out;
    const Eigen::VectorXd r = reduce(features, {1, 1}, weights.col(0), op_.matrix_mix);
    const Eigen::VectorXd a = reduce(features, {1, 0}, weights.col(1), op_.vector_mix);
    const Eigen::VectorXd b = reduce(features, {0, 1}, weights.col(1), op_.vector_mix);
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) out[3 * i + j] = r[3 * to_xyz[i] + to_xyz[j]];
      out[15 + i] = a[to_xyz[i]];
      out[18 + i] = b[to_xyz[i]];
    }
    out.segment<6>(9) = positions.transpose() * weights.col(2);
    return out;
  }

  const ops::Head op_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::Head& op) {
  return std::make_unique<HeadKernel<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::Head& op) {
  return std::make_unique<HeadKernel<double>>(op);
}

}  // namespace bitr::cpu
