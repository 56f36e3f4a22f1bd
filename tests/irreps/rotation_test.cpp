#include "irreps/rotation.hpp"

#include <gtest/gtest.h>

#include "support/npy_fixture.hpp"
#include "support/random_motion.hpp"

namespace bitr::irreps {
namespace {

TEST(Wigner, EqualsTheMeasuredMatrices) {
  Eigen::Matrix3d R;  // (x, y, z) → (−x, z, y)
  R << -1, 0, 0, 0, 0, 1, 0, 1, 0;
  for (int l = 1; l <= 3; ++l) {
    const auto golden = test::read_npy_matrix("golden/escnn/so3_irrep_J_" + std::to_string(l) + ".npy");
    ASSERT_EQ(golden.rows(), 2 * l + 1);
    EXPECT_LE((wigner(l, R) - golden).cwiseAbs().maxCoeff(), 1e-13) << l;
  }
}

TEST(Wigner, IsAnOrthogonalHomomorphism) {
  Random random(5);
  for (int trial = 0; trial < 20; ++trial) {
    const Eigen::Matrix3d A = test::random_rotation(random), B = test::random_rotation(random);
    for (int l = 0; l <= 4; ++l) {
      const auto a = wigner(l, A), b = wigner(l, B);
      EXPECT_LE((a * b - wigner(l, A * B)).cwiseAbs().maxCoeff(), 1e-13);
      EXPECT_LE((a.transpose() * a - Eigen::MatrixXd::Identity(2 * l + 1, 2 * l + 1)).cwiseAbs().maxCoeff(),
                1e-13);
    }
  }
}

TEST(Representation, ActsDegreeByDegreeOnBothSides) {
  Random random(6);
  const Fiber fiber{{{0, 0}, 3}, {{0, 1}, 1}, {{1, 0}, 2}, {{1, 1}, 2}};
  const Eigen::Matrix3d R1 = test::random_rotation(random), R2 = test::random_rotation(random);
  const Eigen::MatrixXd full = representation(fiber, R1, R2);
  ASSERT_EQ(full.rows(), 3 + 3 + 6 + 18);
  EXPECT_TRUE(full.topLeftCorner(3, 3).isIdentity(0));
  // A rank-one (1,1) feature u ⊗ w turns into (D u) ⊗ (D w).
  const Eigen::Vector3d u = Eigen::Vector3d::Random(), w = Eigen::Vector3d::Random();
  Eigen::VectorXd row = Eigen::VectorXd::Zero(fiber.size());
  const auto outer = [](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> m = a * b.transpose();
    return Eigen::Matrix<double, 9, 1>(Eigen::Map<const Eigen::Matrix<double, 9, 1>>(m.data()));
  };
  row.segment<9>(fiber.offset({1, 1}) + 9) = outer(u, w);
  const Eigen::VectorXd turned = full * row;
  EXPECT_LE(
      (turned.segment<9>(fiber.offset({1, 1}) + 9) - outer(wigner(1, R1) * u, wigner(1, R2) * w)).norm(),
      1e-13);
}

}  // namespace
}  // namespace bitr::irreps
