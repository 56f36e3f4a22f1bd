#include "cpu/cloud_coefficients.hpp"
#include "cpu/constant_gradient.hpp"

namespace bitr::cpu {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// From the gradient of a condensed matrix: that of the full one; adds to that of the appended features.
MatrixXd expand(const MatrixXd& d_condensed, const MatrixXd& full, int own, const VectorXd& appended,
                VectorXd& d_appended) {
  MatrixXd d_full(full.rows(), full.cols());
  const VectorXd last = d_condensed.col(own);
  d_full.leftCols(own) = d_condensed.leftCols(own);
  d_full.middleCols(own, appended.size()) = last * appended.transpose();
  d_full.rightCols<1>() = last;
  d_appended += full.middleCols(own, appended.size()).transpose() * last;
  return d_full;
}

// What the gradient of one cloud's coefficients leads to.
struct CloudGradient {
  ops::CloudCoefficients constants;
  VectorXd scalars;
  MatrixXd vectors;  // c₁ × 3
};

template <class T>
class CloudCoefficientsGradient : public Kernel<T> {
 public:
  explicit CloudCoefficientsGradient(const ops::Gradient<ops::CloudCoefficients>& op) : op_(op) {}

  void run(const Arguments& args) const override {
    const GradientSlots<ops::CloudCoefficients> slots{op_, args};
    const std::uint32_t clouds = args.layout.clouds();
    std::vector<CloudGradient> parts(clouds);
    args.pool.parallel_for(clouds, 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const auto cloud = static_cast<std::uint32_t>(i);
        parts[i] = of_cloud(slots, cloud, args.layout.other(cloud));
      }
    });
    for (std::uint32_t cloud = 0; cloud < clouds; ++cloud)
      write_inputs(slots, parts[cloud], parts[args.layout.other(cloud)], cloud);
    for (std::uint32_t cloud = 1; cloud < clouds; ++cloud)
      add_constants(parts[0].constants, parts[cloud].constants);
    store_constants<T>(slots.constants(), parts[0].constants);
  }

 private:
  using Slots = GradientSlots<ops::CloudCoefficients>;

  static VectorXd row(const Slot& slot, std::size_t i) {
    return Eigen::Map<const Eigen::Matrix<T, Eigen::Dynamic, 1>>(slot.as<T>() + i * slot.stride(), slot.width)
        .template cast<double>();
  }

  // Follows the forward kernel's `write` backwards.
  CloudGradient of_cloud(const Slots& slots, std::uint32_t cloud, std::uint32_t other) const {
    const ops::PointAttention &full = op_.op.full, &layer = op_.op.layer;
    const int c0 = layer.c0, c1 = layer.c1, extra = full.c0 - c0, heads = layer.heads, n = layer.n0(),
              n_full = full.n0(), z = c0 + 1, z_full = full.c0 + 1;
    const VectorXd mean = row(slots.in(0), cloud), other_mean = row(slots.in(0), other);
    VectorXd scalars(extra);
    scalars << row(slots.in(1), cloud), row(slots.in(1), other), mean.head(c0), other_mean.head(c0);

    MatrixXd path = MatrixXd::Zero(n, n_full), d_path = path;
    VectorXd constant = VectorXd::Zero(n_full), d_constant = constant, d_scalars = VectorXd::Zero(extra);
    path.topLeftCorner(c0, c0).setIdentity();
    path.block(c0, full.c0, c1, c1).setIdentity();
    path.block(c0 + c1, full.c0 + c1, 3, c1) =
        Eigen::Map<const RowMatrix<double>>(mean.data() + c0, c1, 3).transpose();
    constant.segment(c0, extra) = scalars;

    const T* grad_output = slots.grad_output(0)->as<T>() + cloud * slots.grad_output(0)->stride();
    const auto take = [&grad_output](int rows, int cols) {
      const MatrixXd block = Eigen::Map<const RowMatrix<T>>(grad_output, rows, cols).template cast<double>();
      grad_output += rows * cols;
      return block;
    };
    const MatrixXd gM = take(heads * n, z), gO = take(layer.m0, heads * n), gS = take(layer.m0, z),
                   gMz = take(heads * z, z), gOz = take(layer.m0, heads * z);

    CloudGradient gradient{ops::zeros_like(op_.op), {}, {}};
    ops::PointAttention& d = gradient.constants.full;
    d.S0 = expand(gS, full.S0, c0, scalars, d_scalars);
    for (int h = 0; h < heads; ++h) {
      const MatrixXd M_full = full.M0.middleRows(h * n_full, n_full),
                     Mz_full = full.Mz0.middleRows(h * z_full, z_full),
                     O = full.O0.middleCols(h * n_full, n_full), Oz = full.Oz0.middleCols(h * z_full, z_full),
                     M = condense(M_full, c0, scalars), Mz = condense(Mz_full, c0, scalars);
      const MatrixXd gM_h = gM.middleRows(h * n, n), gO_h = gO.middleCols(h * n, n);
      const VectorXd last_row = gMz.row(h * z + c0), last_column = gOz.col(h * z + c0),
                     bias = gS.col(c0) - last_column;  // the gradient of O · constant

      const MatrixXd dM = path.transpose() * gM_h - constant * last_row.transpose();
      MatrixXd dMz(z_full, z);
      dMz << gMz.middleRows(h * z, c0), scalars * last_row.transpose(), last_row.transpose();
      d.M0.middleRows(h * n_full, n_full) = expand(dM, M_full, c0, scalars, d_scalars);
      d.Mz0.middleRows(h * z_full, z_full) = expand(dMz, Mz_full, c0, scalars, d_scalars);
      d.O0.middleCols(h * n_full, n_full) = gO_h * path + bias * constant.transpose();
      d.Oz0.middleCols(h * z_full, z_full) << gOz.middleCols(h * z, c0), last_column * scalars.transpose(),
          last_column;

      d_path += gM_h * M.transpose() + gO_h.transpose() * O;
      d_constant += O.transpose() * bias - M * last_row;
      d_scalars += Mz.middleRows(c0, extra) * last_row + Oz.middleCols(c0, extra).transpose() * last_column;
    }
    gradient.scalars = d_scalars + d_constant.segment(c0, extra);
    gradient.vectors = d_path.block(c0 + c1, full.c0 + c1, 3, c1).transpose();
    return gradient;
  }

  // A cloud's globals and scalar means are also the other cloud's; scalars: own globals, the other's, own
  // means, the other's.
  void write_inputs(const Slots& slots, const CloudGradient& own, const CloudGradient& other,
                    std::uint32_t cloud) const {
    const int c0 = op_.op.layer.c0, c1 = op_.op.layer.c1, globals = slots.in(1).width;
    const auto both = [&](int begin, int size) {
      return VectorXd(own.scalars.segment(begin, size) + other.scalars.segment(begin + size, size));
    };
    if (const Slot* slot = slots.grad_input(0)) {
      T* to = slot->as<T>() + cloud * slot->stride();
      Eigen::Map<Eigen::Matrix<T, Eigen::Dynamic, 1>>(to, c0) = both(2 * globals, c0).template cast<T>();
      Eigen::Map<RowMatrix<T>>(to + c0, c1, 3) = own.vectors.template cast<T>();
    }
    if (const Slot* slot = slots.grad_input(1))
      Eigen::Map<Eigen::Matrix<T, Eigen::Dynamic, 1>>(slot->as<T>() + cloud * slot->stride(), globals) =
          both(0, globals).template cast<T>();
  }

  const ops::Gradient<ops::CloudCoefficients> op_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::Gradient<ops::CloudCoefficients>& op) {
  return std::make_unique<CloudCoefficientsGradient<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::Gradient<ops::CloudCoefficients>& op) {
  return std::make_unique<CloudCoefficientsGradient<double>>(op);
}

}  // namespace bitr::cpu
