#include "cpu/cloud_coefficients.hpp"

#include "cpu/kernel.hpp"

namespace bitr::cpu {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

template <class T>
class CloudCoefficientsKernel : public Kernel<T> {
 public:
  explicit CloudCoefficientsKernel(const ops::CloudCoefficients& op) : op_(op) {}

  void run(const Arguments& args) const override {
    const Slot &means = args.in[0], &globals = args.in[1], &out = args.out[0];
    const auto row = [](const Slot& slot, std::size_t i) {
      return VectorXd(
          Eigen::Map<const Eigen::Matrix<T, Eigen::Dynamic, 1>>(slot.as<T>() + i * slot.stride(), slot.width)
              .template cast<double>());
    };
    for (std::uint32_t cloud = 0; cloud < args.layout.clouds(); ++cloud) {
      const std::uint32_t other = args.layout.other(cloud);
      const VectorXd mean = row(means, cloud), other_mean = row(means, other);
      VectorXd scalars(op_.full.c0 - op_.layer.c0);
      scalars << row(globals, cloud), row(globals, other), mean.head(op_.layer.c0),
          other_mean.head(op_.layer.c0);
      const RowMatrix<double> vectors =
          Eigen::Map<const RowMatrix<double>>(mean.data() + op_.layer.c0, op_.layer.c1, 3);
      write(scalars, vectors, out.as<T>() + cloud * out.stride());
    }
  }

 private:
  // Paths of the extended features (rows of M, columns of O) in terms of the layer's own:
  // [f⁰ own ; v·f¹ own ; v], plus, for constants of degree 0, one path that is 1 on every edge.
  struct Paths {
    MatrixXd own;       // own paths × extended paths
    VectorXd constant;  // extended paths
  };
  Paths paths(const VectorXd& scalars, const RowMatrix<double>& vectors) const {
    const int c0 = op_.layer.c0, c1 = op_.layer.c1, all0 = op_.full.c0;
    Paths p{MatrixXd::Zero(op_.layer.n0(), op_.full.n0()), VectorXd::Zero(op_.full.n0())};
    p.own.topLeftCorner(c0, c0).setIdentity();
    p.own.block(c0, all0, c1, c1).setIdentity();
    p.own.block(c0 + c1, all0 + c1, 3, c1) = vectors.transpose();
    p.constant.segment(c0, all0 - c0) = scalars;
    return p;
  }

  void write(const VectorXd& scalars, const RowMatrix<double>& vectors, T* to) const {
    const ops::PointAttention &full = op_.full, &layer = op_.layer;
    const int heads = layer.heads, n = layer.n0(), n_full = full.n0(), z = layer.c0 + 1, z_full = full.c0 + 1;
    const Paths path = paths(scalars, vectors);

    MatrixXd M0(heads * n, z), O0(layer.m0, heads * n), Mz0 = MatrixXd::Zero(heads * z, z),
                                                        Oz0(layer.m0, heads * z);
    MatrixXd S0 = condense(full.S0, layer.c0, scalars);
    for (int h = 0; h < heads; ++h) {
      const MatrixXd M = condense(full.M0.middleRows(h * n_full, n_full), layer.c0, scalars);
      const MatrixXd Mz = condense(full.Mz0.middleRows(h * z_full, z_full), layer.c0, scalars);
      const MatrixXd O = full.O0.middleCols(h * n_full, n_full), Oz = full.Oz0.middleCols(h * z_full, z_full);
      const int c0 = layer.c0, extra = full.c0 - c0;
      M0.middleRows(h * n, n) = path.own * M;
      O0.middleCols(h * n, n) = O * path.own.transpose();
      // Constant paths: the same on every edge of positive length, so they leave the softmax and join the
      // bias; an edge of length zero carries the difference.
      S0.col(c0) += O * path.constant;
      Mz0.middleRows(h * z, c0) = Mz.topRows(c0);
      Mz0.row(h * z + c0) =
          scalars.transpose() * Mz.middleRows(c0, extra) + Mz.row(full.c0) - path.constant.transpose() * M;
      Oz0.middleCols(h * z, c0) = Oz.leftCols(c0);
      Oz0.col(h * z + c0) = Oz.middleCols(c0, extra) * scalars + Oz.col(full.c0) - O * path.constant;
    }
    for (const MatrixXd* matrix : {&M0, &O0, &S0, &Mz0, &Oz0}) {
      Eigen::Map<RowMatrix<T>>(to, matrix->rows(), matrix->cols()) = matrix->template cast<T>();
      to += matrix->size();
    }
  }

  const ops::CloudCoefficients op_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::CloudCoefficients& op) {
  return std::make_unique<CloudCoefficientsKernel<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::CloudCoefficients& op) {
  return std::make_unique<CloudCoefficientsKernel<double>>(op);
}

}  // namespace bitr::cpu
