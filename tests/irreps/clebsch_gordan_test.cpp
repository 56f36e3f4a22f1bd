#include "irreps/clebsch_gordan.hpp"

#include <gtest/gtest.h>

#include <cstdlib>

#include "irreps/rotation.hpp"
#include "support/npy_fixture.hpp"
#include "support/random_motion.hpp"

namespace bitr::irreps {
namespace {

TEST(ClebschGordan, EqualsTheMeasuredMatrices) {
  for (int a = 0; a <= 2; ++a)
    for (int b = 0; b <= 2; ++b) {
      const auto golden =
          test::read_npy_matrix("golden/escnn/cg_" + std::to_string(a) + "_" + std::to_string(b) + ".npy");
      const auto& q = clebsch_gordan(a, b);
      ASSERT_EQ(golden.rows(), q.rows());
      EXPECT_LE((golden - q).cwiseAbs().maxCoeff(), 1e-14) << a << " ⊗ " << b;
    }
}

TEST(ClebschGordan, IsOrthogonal) {
  for (int a = 0; a <= max_coupled_degree; ++a)
    for (int b = 0; b <= max_coupled_degree; ++b) {
      const auto& q = clebsch_gordan(a, b);
      EXPECT_LE((q.transpose() * q - Eigen::MatrixXd::Identity(q.rows(), q.rows())).cwiseAbs().maxCoeff(),
                1e-13);
    }
}

TEST(ClebschGordan, SplitsTheProductUnderEveryRotation) {
  Random random(1);
  for (int a = 0; a <= max_coupled_degree; ++a)
    for (int b = 0; b <= max_coupled_degree; ++b) {
      const Eigen::Matrix3d R1 = test::random_rotation(random);
      const Eigen::MatrixXd product = wigner({a, b}, R1, R1);
      for (int J = std::abs(a - b); J <= std::min(a + b, 4); ++J) {
        const Eigen::MatrixXd q = clebsch_gordan_block(a, b, J);
        EXPECT_LE((product * q - q * wigner(J, R1)).cwiseAbs().maxCoeff(), 1e-12) << a << b << J;
      }
    }
}

}  // namespace
}  // namespace bitr::irreps
