// The pose's projection on awkward matrices: the CPU in float and in double, and Vulkan. A rotation is as
// well determined as the gap (s₂ ± s₃)/s₁ is wide, − for reflections; what holds without any gap is that it
// is a rotation and that none lies nearer.
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "core/random.hpp"
#include "ops/head.hpp"
#include "ops/pose.hpp"
#include "support/op_run.hpp"
#include "support/random_motion.hpp"
#include "support/vulkan.hpp"

namespace bitr {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using graph::BatchLayout;
using graph::Rows;
using test::OpTensor;

using Matrix3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using Pieces = Eigen::Matrix<double, ops::piece_count, 1>;
using Pose = Eigen::Matrix<double, ops::pose_width, 1>;

using Backend = std::function<std::vector<Pose>(const std::vector<Pieces>&)>;

std::vector<Pose> run(
    const std::vector<Pieces>& all,
    const std::function<OpTensor(const BatchLayout&, const OpTensor&, const OpTensor&)>& op) {
  const BatchLayout layout(std::vector<std::uint32_t>(2 * all.size(), 3), 4);
  OpTensor pieces{Rows::pair, 1, ops::piece_count, false, {}, {}};
  for (const Pieces& p : all) pieces.values.insert(pieces.values.end(), p.begin(), p.end());
  const OpTensor out = op(layout, pieces, {Rows::pair, 1, ops::pose_width, false, {}, {}});
  std::vector<Pose> poses;
  for (std::size_t i = 0; i + ops::pose_width <= out.values.size(); i += ops::pose_width)
    poses.emplace_back(Eigen::Map<const Pose>(out.values.data() + i));
  return poses;
}

template <class T>
std::vector<Pose> run_cpu(const std::vector<Pieces>& all) {
  return run(all, [](const BatchLayout& layout, const OpTensor& in, const OpTensor& out) {
    ThreadPool pool(1);
    return test::run_op<T>(ops::ProjectPose{}, layout, {in}, {out}, pool).front();
  });
}

std::vector<Pose> run_vulkan(const std::vector<Pieces>& all) {
  return run(all, [](const BatchLayout& layout, const OpTensor& in, const OpTensor& out) {
    const auto results = test::run_op_vulkan(ops::ProjectPose{}, layout, {in}, {out});
    return results.empty() ? OpTensor{} : results.front();
  });
}

std::vector<std::pair<const char*, Backend>> backends() {
  std::vector<std::pair<const char*, Backend>> all = {{"double", run_cpu<double>}, {"float", run_cpu<float>}};
  if (test::vulkan()) all.emplace_back("Vulkan", run_vulkan);
  return all;
}

// r̂ maps the source's frame to the reference's; pieces hold its transpose. Rounded to float, as is the rest.
Pieces pieces_of(const Matrix3d& r_hat, Random& random) {
  Pieces pieces;
  Eigen::Map<Matrix3>(pieces.data()) = r_hat.transpose();
  for (int i = 9; i < ops::piece_count; ++i) pieces[i] = random.uniform(-1, 1);
  return pieces.cast<float>().cast<double>();
}

Matrix3d with_singular_values(Random& random, const Vector3d& s) {
  return test::random_rotation(random) * s.asDiagonal() * test::random_rotation(random).transpose();
}

Matrix3d random_matrix(Random& random) {
  Matrix3d m;
  for (int i = 0; i < 9; ++i) m(i / 3, i % 3) = random.uniform(-1, 1);
  return m;
}

// Scaled to norm 1, or by the floor.
Matrix3d normalised(const Pieces& pieces) {
  const Matrix3d r = Eigen::Map<const Matrix3>(pieces.data()).transpose();
  return r / std::max(r.stableNorm(), ops::matrix_norm_floor);
}

void check(const Pieces& pieces, const Pose& pose, const Pose& exact, Random& random) {
  const Matrix3d R = Eigen::Map<const Matrix3>(pose.data()), truth = Eigen::Map<const Matrix3>(exact.data());
  const Matrix3d r_hat = normalised(pieces);
  SCOPED_TRACE(testing::Message() << "r̂ =\n" << r_hat << "\nR =\n" << R << "\nexactly\n" << truth);
  ASSERT_TRUE(pose.allFinite());
  EXPECT_LE((R.transpose() * R - Matrix3d::Identity()).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_NEAR(R.determinant(), 1, 2e-6);

  const Vector3d s = exact.segment<3>(12), got = pose.segment<3>(12);
  EXPECT_LE((got - s).cwiseAbs().maxCoeff(), ops::ProjectPose::singular_value_error * s[0]);
  EXPECT_TRUE(got[0] >= got[1] && got[1] >= got[2] && got[2] >= 0) << got.transpose();

  EXPECT_NEAR(std::abs(pose[15]), 1, 1e-6);
  const double sign = exact[15] > 0 ? 1 : -1;
  if (s[2] > 1e-6 * s[0]) {
    EXPECT_EQ(pose[15] > 0, exact[15] > 0);
  }
  const double gap = s[0] > 0 ? (s[1] + sign * s[2]) / s[0] : 0;
  if (gap > 1e-3) {
    EXPECT_LE((R - truth).cwiseAbs().maxCoeff(),
              ops::ProjectPose{}.float_error() * ops::ProjectPose::well_determined / gap);
  }

  // The nearest rotation is the one of the largest trace(Rᵀ r̂).
  const double trace = (R.transpose() * r_hat).trace(), tolerance = 2e-6 * s[0];
  EXPECT_GE(trace, s[0] + s[1] + sign * s[2] - tolerance);
  for (int i = 0; i < 20; ++i) {
    const double angle = std::pow(10, random.uniform(-4, 0.5));
    const Matrix3d other = i < 5 ? test::random_rotation(random)
                                 : Eigen::AngleAxisd(angle, test::random_rotation(random).col(0)) * R;
    EXPECT_GE(trace, (other.transpose() * r_hat).trace() - tolerance);
  }

  const auto at = [&](int i) { return Vector3d(pieces.segment<3>(i)); };
  const Vector3d moved = at(9) + at(15), t = at(12) + at(18) - R * moved;
  EXPECT_LE((pose.segment<3>(9) - t).cwiseAbs().maxCoeff(),
            2e-6 * (at(9).norm() + at(15).norm() + at(12).norm() + at(18).norm()));
}

void check_all(const std::vector<Matrix3d>& matrices) {
  Random random(5);
  std::vector<Pieces> pieces;
  for (const Matrix3d& m : matrices) pieces.push_back(pieces_of(m, random));
  const auto exact = run_cpu<double>(pieces);
  for (const auto& [name, backend] : backends()) {
    SCOPED_TRACE(name);
    const auto poses = backend(pieces);
    ASSERT_EQ(poses.size(), pieces.size());
    for (std::size_t i = 0; i < pieces.size(); ++i) check(pieces[i], poses[i], exact[i], random);
  }
}

TEST(ProjectPose, RandomMatrices) {
  Random random(1);
  std::vector<Matrix3d> matrices;
  for (int i = 0; i < 1000; ++i) matrices.push_back(random_matrix(random));
  check_all(matrices);
}

TEST(ProjectPose, RotationsAndReflections) {
  Random random(2);
  std::vector<Matrix3d> matrices = {Matrix3d::Identity(), -Matrix3d::Identity()};
  // Every signed permutation of the axes: half of them rotations, half reflections.
  int order[] = {0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      Matrix3d m = Matrix3d::Zero();
      for (int i = 0; i < 3; ++i) m(i, order[i]) = signs >> i & 1 ? -1 : 1;
      matrices.push_back(m);
    }
  } while (std::next_permutation(order, order + 3));
  for (int i = 0; i < 200; ++i) {
    matrices.push_back(test::random_rotation(random));
    matrices.push_back(-test::random_rotation(random));
  }
  check_all(matrices);
}

TEST(ProjectPose, SingularValuesNearEachOther) {
  Random random(3);
  std::vector<Matrix3d> matrices;
  for (const double d : {1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 0.0})
    for (const double least : {1.0, 0.5, 1e-2, 1e-4})
      for (const double sign : {1.0, -1.0})
        for (int i = 0; i < 10; ++i) {
          matrices.push_back(with_singular_values(random, {1, 1 - d, sign * (1 - 2 * d) * least}));
          matrices.push_back(with_singular_values(random, {1, least, sign * (1 - d) * least}));
        }
  check_all(matrices);
}

TEST(ProjectPose, WithoutFullRank) {
  Random random(4);
  std::vector<Matrix3d> matrices;
  for (const double s2 : {1.0, 0.999999, 0.3, 1e-2, 1e-4, 1e-6, 1e-8, 1e-12, 1e-30, 0.0})
    for (const double ratio : {0.0, 1e-7, 1e-3, 1.0})
      for (const double sign : {1.0, -1.0}) {
        for (int i = 0; i < 10; ++i)
          matrices.push_back(with_singular_values(random, {1, s2, sign * ratio * s2}));
        // Along the axes, where nothing is rounded.
        const Vector3d diagonal(1, s2, sign * ratio * s2);
        matrices.emplace_back(diagonal.asDiagonal());
        matrices.emplace_back(diagonal.reverse().asDiagonal());
      }
  // Rank one and two in whole numbers.
  matrices.push_back(Vector3d(1, 2, 3) * Eigen::RowVector3d(3, -1, 2));
  matrices.push_back(Vector3d(1, 1, 1) * Eigen::RowVector3d(1, 1, 1));
  matrices.push_back(Vector3d(1, 0, 1) * Eigen::RowVector3d(1, 1, 0) +
                     Vector3d(0, 2, 1) * Eigen::RowVector3d(-1, 1, 4));
  check_all(matrices);
}

TEST(ProjectPose, OfAnySize) {
  Random random(6);
  std::vector<Matrix3d> matrices;
  for (const double size : {1e-30, 1e-20, 1e-10, 3e-6, 1e-5, 1e-3, 1e3, 1e10, 1e25, 1e38})
    for (int i = 0; i < 30; ++i) matrices.emplace_back(size * random_matrix(random));
  check_all(matrices);
}

TEST(ProjectPose, OfNothingIsTheIdentity) {
  Random random(7);
  const std::vector<Pieces> pieces = {pieces_of(Matrix3d::Zero(), random),
                                      pieces_of(-Matrix3d::Zero(), random)};
  for (const auto& [name, backend] : backends())
    for (const Pose& pose : backend(pieces)) {
      SCOPED_TRACE(name);
      EXPECT_EQ(Matrix3(Eigen::Map<const Matrix3>(pose.data())), Matrix3(Matrix3::Identity()));
      EXPECT_EQ(Vector3d(pose.segment<3>(12)), Vector3d(Vector3d::Zero()));
      EXPECT_EQ(pose[15], 1);
    }
}

TEST(ProjectPose, OfWhatIsNotANumberIsNotOne) {
  Random random(8);
  std::vector<Pieces> pieces;
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
                           -std::numeric_limits<double>::infinity()})
    for (int i = 0; i < ops::piece_count; ++i) {
      pieces.push_back(pieces_of(random_matrix(random), random));
      pieces.back()[i] = bad;
      pieces.push_back(pieces_of(random_matrix(random), random));
    }
  for (const auto& [name, backend] : backends()) {
    SCOPED_TRACE(name);
    const auto poses = backend(pieces);
    ASSERT_EQ(poses.size(), pieces.size());
    for (std::size_t i = 0; i < poses.size(); ++i)
      for (int j = 0; j < ops::pose_width; ++j)
        EXPECT_EQ(std::isnan(poses[i][j]), i % 2 == 0)
            << "piece " << i / 2 % ops::piece_count << ", number " << j;
  }
}

}  // namespace
}  // namespace bitr
