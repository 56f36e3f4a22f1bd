// The projection's derivative. With r̂ = U S Vᵀ, V's last column negated where U Vᵀ is a reflection and s₃
// with it, r̂ = R H with R = U Vᵀ and H = V S Vᵀ symmetric. RᵀdR is antisymmetric, so that in V's basis
//   (Uᵀ dR V)ᵢⱼ = (Pᵢⱼ − Pⱼᵢ)/(sᵢ + sⱼ),  P = Uᵀ dr̂ V,
// where equal singular values need no care. A sum sᵢ + sⱼ vanishes only where R itself jumps.
// The norm of r counts as a constant: R does not depend on it. Singular values and determinant have no
// gradient.
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <limits>

#include "cpu/kernel.hpp"

namespace bitr::cpu {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using RowMatrix3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using Pieces = Eigen::Matrix<double, ops::piece_count, 1>;

// Below this the projection turns by more than the step it is differentiated for.
constexpr double sum_floor = 1e-6;

template <class T>
class ProjectPoseGradient : public Kernel<T> {
 public:
  explicit ProjectPoseGradient(const ops::Gradient<ops::ProjectPose>& op) : op_(op) {}

  void run(const Arguments& args) const override {
    const GradientSlots<ops::ProjectPose> slots{op_, args};
    const Slot *grad_output = slots.grad_output(0), *grad_input = slots.grad_input(0);
    if (!grad_input) return;
    for (std::size_t pair = 0; pair < args.layout.pairs(); ++pair) {
      const Pieces pieces = Eigen::Map<const Eigen::Matrix<T, ops::piece_count, 1>>(slots.in(0).as<T>() +
                                                                                    pair * ops::piece_count)
                                .template cast<double>();
      Eigen::Matrix<double, ops::pose_width, 1> pose = Eigen::Matrix<double, ops::pose_width, 1>::Zero();
      if (grad_output)
        pose = Eigen::Map<const Eigen::Matrix<T, ops::pose_width, 1>>(grad_output->as<T>() +
                                                                      pair * ops::pose_width)
                   .template cast<double>();
      Eigen::Map<Eigen::Matrix<T, ops::piece_count, 1>>(grad_input->as<T>() + pair * ops::piece_count) =
          gradient(pieces, Eigen::Map<const RowMatrix3>(pose.data()), pose.segment<3>(9)).template cast<T>();
    }
  }

 private:
  static Pieces gradient(const Pieces& pieces, Matrix3d rotation, const Vector3d& translation) {
    if (!pieces.allFinite()) return Pieces::Constant(std::numeric_limits<double>::quiet_NaN());
    const Matrix3d r = Eigen::Map<const RowMatrix3>(pieces.data()).transpose();
    const double norm = std::max(r.norm(), ops::matrix_norm_floor);
    const Eigen::JacobiSVD<Matrix3d> svd(r / norm, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Matrix3d& U = svd.matrixU();
    Matrix3d V = svd.matrixV();
    Vector3d s = svd.singularValues();
    if ((U * V.transpose()).determinant() <= 0) {
      V.col(2) *= -1;
      s[2] *= -1;
    }
    const Vector3d first = pieces.segment<3>(9) + pieces.segment<3>(15);
    rotation -= translation * first.transpose();
    const Matrix3d turned = U.transpose() * rotation * V;
    Matrix3d inner;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        inner(i, j) = (turned(i, j) - turned(j, i)) / std::max(s[i] + s[j], sum_floor);
    Pieces out;
    Eigen::Map<RowMatrix3>(out.data()) = (U * inner * V.transpose() / norm).transpose();
    out.segment<3>(9) = out.segment<3>(15) = -(V * (U.transpose() * translation));
    out.segment<3>(12) = out.segment<3>(18) = translation;
    return out;
  }

  const ops::Gradient<ops::ProjectPose> op_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::Gradient<ops::ProjectPose>& op) {
  return std::make_unique<ProjectPoseGradient<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::Gradient<ops::ProjectPose>& op) {
  return std::make_unique<ProjectPoseGradient<double>>(op);
}

}  // namespace bitr::cpu
