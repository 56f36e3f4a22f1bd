#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <limits>

#include "cpu/kernel.hpp"

namespace bitr::cpu {
namespace {

template <class T>
class ProjectPoseKernel : public Kernel<T> {
 public:
  void run(const Arguments& args) const override {
    for (std::size_t pair = 0; pair < args.layout.pairs(); ++pair) {
      const Eigen::Matrix<double, ops::piece_count, 1> pieces =
          Eigen::Map<const Eigen::Matrix<T, ops::piece_count, 1>>(args.in[0].as<T>() +
                                                                  pair * ops::piece_count)
              .template cast<double>();
      Eigen::Map<Eigen::Matrix<T, ops::pose_width, 1>>(args.out[0].as<T>() + pair * ops::pose_width) =
          project(pieces).cast<T>();
    }
  }

 private:
  static Eigen::Matrix<double, ops::pose_width, 1> project(
      const Eigen::Matrix<double, ops::piece_count, 1>& pieces) {
    using Matrix3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
    Eigen::Matrix<double, ops::pose_width, 1> out;
    // Stored with rows on the source's side: the transpose maps the source's frame to the reference's.
    const Eigen::Matrix3d r = Eigen::Map<const Matrix3>(pieces.data()).transpose();
    if (!pieces.allFinite()) {
      out.setConstant(std::numeric_limits<double>::quiet_NaN());
      return out;
    }
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(r / std::max(r.norm(), ops::matrix_norm_floor),
                                                Eigen::ComputeFullU | Eigen::ComputeFullV);
    Eigen::Matrix3d v = svd.matrixV();
    const double determinant = (svd.matrixU() * v.transpose()).determinant();
    if (determinant <= 0) v.col(2) *= -1;
    const Eigen::Matrix3d R = svd.matrixU() * v.transpose();
    Eigen::Map<Matrix3>(out.data()) = R;
    out.segment<3>(9) =
        pieces.segment<3>(12) + pieces.segment<3>(18) - R * (pieces.segment<3>(9) + pieces.segment<3>(15));
    out.segment<3>(12) = svd.singularValues();
    out[15] = determinant;
    return out;
  }
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::ProjectPose&) {
  return std::make_unique<ProjectPoseKernel<float>>();
}
template <>
KernelPtr<double> make_kernel(const ops::ProjectPose&) {
  return std::make_unique<ProjectPoseKernel<double>>();
}

}  // namespace bitr::cpu
