#include "irreps/harmonics.hpp"

#include <gtest/gtest.h>

#include "irreps/rotation.hpp"
#include "support/npy_fixture.hpp"
#include "support/random_motion.hpp"

namespace bitr::irreps {
namespace {

constexpr int count = harmonic_count(max_harmonic_degree);

Eigen::Matrix<double, count, 1> harmonics(const Eigen::Vector3d& v) {
  Eigen::Matrix<double, count, 1> y;
  spherical_harmonics(max_harmonic_degree, v.data(), y.data());
  return y;
}

TEST(SphericalHarmonics, EqualTheMeasuredValues) {
  const Eigen::MatrixXd points = test::read_npy_matrix("golden/escnn/sh_points.npy");
  const Eigen::MatrixXd values = test::read_npy_matrix("golden/escnn/sh_values_deg4.npy");
  ASSERT_EQ(values.cols(), count);
  for (Eigen::Index i = 0; i < points.rows(); ++i)
    EXPECT_LE((harmonics(points.row(i).transpose()) - values.row(i).transpose()).cwiseAbs().maxCoeff(),
              1e-13);
}

TEST(SphericalHarmonics, HaveUnitNormInEveryDegree) {
  Random random(2);
  for (int trial = 0; trial < 50; ++trial) {
    const auto y = harmonics(test::random_unit(random));
    for (int l = 0; l <= max_harmonic_degree; ++l) EXPECT_NEAR(y.segment(l * l, 2 * l + 1).norm(), 1, 1e-14);
  }
}

TEST(SphericalHarmonics, RotateByWignerMatrices) {
  Random random(3);
  for (int trial = 0; trial < 50; ++trial) {
    const Eigen::Matrix3d R = test::random_rotation(random);
    const Eigen::Vector3d v = test::random_unit(random);
    const auto y = harmonics(v), rotated = harmonics(R * v);
    for (int l = 0; l <= max_harmonic_degree; ++l)
      EXPECT_LE((wigner(l, R) * y.segment(l * l, 2 * l + 1) - rotated.segment(l * l, 2 * l + 1)).norm(),
                1e-13);
  }
}

TEST(SphericalHarmonics, VanishAtTheZeroVectorAboveDegreeZero) {
  const auto y = harmonics(Eigen::Vector3d::Zero());
  EXPECT_EQ(y[0], 1);
  EXPECT_EQ(y.tail(count - 1).cwiseAbs().maxCoeff(), 0);
}

TEST(SphericalHarmonics, FloatAgreesWithDouble) {
  Random random(4);
  const Eigen::Vector3f v = test::random_unit(random).cast<float>();
  Eigen::Matrix<float, count, 1> y;
  spherical_harmonics(max_harmonic_degree, v.data(), y.data());
  EXPECT_LE((y.cast<double>() - harmonics(v.cast<double>())).cwiseAbs().maxCoeff(), 1e-6);
}

}  // namespace
}  // namespace bitr::irreps
