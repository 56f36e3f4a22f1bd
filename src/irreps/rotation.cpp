#include "irreps/rotation.hpp"

#include "irreps/clebsch_gordan.hpp"

namespace bitr::irreps {
namespace {

Eigen::MatrixXd kronecker(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  Eigen::MatrixXd product(a.rows() * b.rows(), a.cols() * b.cols());
  for (Eigen::Index i = 0; i < a.rows(); ++i)
    for (Eigen::Index j = 0; j < a.cols(); ++j)
      product.block(i * b.rows(), j * b.cols(), b.rows(), b.cols()) = a(i, j) * b;
  return product;
}

}  // namespace

Eigen::MatrixXd wigner(int l, const Eigen::Matrix3d& R) {
  if (l == 0) return Eigen::MatrixXd::Ones(1, 1);
  // Degree 1 is R itself in the order (y, z, x); each further degree is the top block of D^(l−1) ⊗ D^1.
  const Eigen::PermutationMatrix<3> order(Eigen::Vector3i(2, 0, 1));
  const Eigen::MatrixXd first = order * R * order.transpose();
  Eigen::MatrixXd d = first;
  for (int degree = 2; degree <= l; ++degree) {
    const Eigen::MatrixXd q = clebsch_gordan_block(degree - 1, 1, degree);
    d = q.transpose() * kronecker(d, first) * q;
  }
  return d;
}

Eigen::MatrixXd wigner(Degree degree, const Eigen::Matrix3d& R1, const Eigen::Matrix3d& R2) {
  return kronecker(wigner(degree.p, R1), wigner(degree.q, R2));
}

Eigen::MatrixXd representation(const Fiber& fiber, const Eigen::Matrix3d& R1, const Eigen::Matrix3d& R2) {
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(fiber.size(), fiber.size());
  for (const auto& [degree, channels] : fiber) {
    const Eigen::MatrixXd block = wigner(degree, R1, R2);
    for (int c = 0; c < channels; ++c) {
      const int at = fiber.offset(degree) + c * degree.dim();
      matrix.block(at, at, degree.dim(), degree.dim()) = block;
    }
  }
  return matrix;
}

}  // namespace bitr::irreps
