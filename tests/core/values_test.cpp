// Poses, tensors, random numbers and error names.
#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include <bitr/pose.hpp>
#include <bitr/result.hpp>
#include <cmath>
#include <set>

#include "core/tensor.hpp"
#include "support/random_motion.hpp"
#include "support/turn.hpp"

namespace bitr {
namespace {

double distance(const Vec3d& a, const Vec3d& b) { return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]); }

TEST(Pose, ComposesAndInverts) {
  Random random(1);
  for (int i = 0; i < 100; ++i) {
    const Pose a = test::random_pose(random, 5), b = test::random_pose(random, 5);
    const Vec3d p = {random.normal(), random.normal(), random.normal()};
    EXPECT_LE(distance((a * b).apply(p), a.apply(b.apply(p))), 1e-13);
    EXPECT_LE(distance(a.inverse().apply(a.apply(p)), p), 1e-13);
    EXPECT_LE(distance((a * a.inverse()).translation, {0, 0, 0}), 1e-13);
    EXPECT_LE(distance(a.rotate(p), (Pose{a.rotation, {0, 0, 0}}).apply(p)), 1e-15);
    const auto m = a.matrix();
    for (int r = 0; r < 3; ++r)
      EXPECT_NEAR(m[4 * r] * p[0] + m[4 * r + 1] * p[1] + m[4 * r + 2] * p[2] + m[4 * r + 3], a.apply(p)[r],
                  1e-13);
    EXPECT_EQ(m[12] + m[13] + m[14], 0);
    EXPECT_EQ(m[15], 1);
  }
}

TEST(Pose, RotationErrorIsAccurateAtBothEnds) {
  Random random(2);
  for (const double degrees : {0.0, 1e-12, 1e-7, 1e-3, 1.0, 90.0, 179.0, 179.999, 180 - 1e-6, 180.0}) {
    EXPECT_NEAR(rotation_error_degrees(Pose{}, test::turn_about({0, 0, 1}, degrees)), degrees,
                1e-13 + 1e-12 * degrees);
    // The same angle seen from any frame, to the rounding of the product.
    for (int i = 0; i < 20; ++i) {
      const Pose g = test::random_pose(random), h = test::random_pose(random);
      EXPECT_NEAR(rotation_error_degrees(g * h, g * test::turn_about({0, 0, 1}, degrees) * h), degrees, 1e-6)
          << degrees;
      EXPECT_NEAR(rotation_error_degrees(g * test::turn_about({0, 0, 1}, degrees) * h, g * h), degrees, 1e-6)
          << degrees;
    }
  }
}

TEST(Pose, TranslationErrorIsADistance) {
  EXPECT_DOUBLE_EQ(translation_error({Pose{}.rotation, {1, 2, 3}}, {Pose{}.rotation, {1, 5, 7}}), 5);
}

TEST(Tensor, KeepsShapeBytesAndValues) {
  const Tensor t = Tensor::from({2, 3}, std::vector<float>{0, 1, -2, 3.5f, 4, 5});
  EXPECT_EQ(t.size(), 6u);
  EXPECT_EQ(t.bytes.size(), 24u);
  EXPECT_EQ(t.to_double(), (std::vector<double>{0, 1, -2, 3.5, 4, 5}));
  EXPECT_EQ(Tensor::from({}, std::vector<double>{7}).size(), 1u);
  EXPECT_EQ(Tensor::from({0, 4}, std::vector<double>{}).to_double(), std::vector<double>{});
  EXPECT_EQ(Tensor::from({2}, std::vector<std::int64_t>{-1, std::int64_t{1} << 40}).to_double(),
            (std::vector<double>{-1, 1099511627776.0}));
}

Tensor raw(DType type, const std::vector<unsigned>& bytes) {
  Tensor t{type, {bytes.size() / size_of(type)}, {}};
  for (const unsigned b : bytes) t.bytes.push_back(static_cast<std::byte>(b));
  return t;
}

TEST(Tensor, WidensEveryType) {
  // 1, −2, the smallest subnormal, the largest finite, infinity.
  EXPECT_EQ(raw(DType::f16, {0x00, 0x3c, 0x00, 0xc0, 0x01, 0x00, 0xff, 0x7b, 0x00, 0x7c}).to_double(),
            (std::vector<double>{1, -2, 0x1p-24, 65504, INFINITY}));
  EXPECT_TRUE(std::isnan(raw(DType::f16, {0x01, 0x7c}).to_double()[0]));
  EXPECT_EQ(raw(DType::bf16, {0x80, 0x3f, 0x20, 0xc1}).to_double(), (std::vector<double>{1, -10}));
  EXPECT_EQ(raw(DType::i8, {0xff, 0x7f}).to_double(), (std::vector<double>{-1, 127}));
  EXPECT_EQ(raw(DType::u8, {0xff}).to_double(), std::vector<double>{255});
  EXPECT_EQ(raw(DType::boolean, {1, 0}).to_double(), (std::vector<double>{1, 0}));
  EXPECT_EQ(raw(DType::i16, {0xfe, 0xff}).to_double(), std::vector<double>{-2});
  EXPECT_EQ(raw(DType::i32, {0, 0, 0, 0x80}).to_double(), std::vector<double>{-2147483648.0});
}

TEST(Tensor, TypesHaveTheSafetensorsNames) {
  const std::pair<DType, const char*> names[] = {
      {DType::f16, "F16"}, {DType::bf16, "BF16"},   {DType::f32, "F32"}, {DType::f64, "F64"},
      {DType::i8, "I8"},   {DType::u8, "U8"},       {DType::i16, "I16"}, {DType::i32, "I32"},
      {DType::i64, "I64"}, {DType::boolean, "BOOL"}};
  for (const auto& [type, text] : names) EXPECT_EQ(name(type), text);
}

// Fixed for good: files written with a seed have to come out the same on every platform and in every version.
TEST(Random, IsFixed) {
  std::mt19937_64 standard(0x9e3779b97f4a7c15ULL);  // seed 0 of ours
  Random random(0);
  EXPECT_EQ(random.bits(), standard());
  EXPECT_EQ(random.uniform(), static_cast<double>(standard() >> 11) * 0x1p-53);
}

TEST(Random, HasTheMomentsOfItsDistributions) {
  Random random(5);
  constexpr int n = 200000;
  double uniform = 0, normal = 0, square = 0;
  std::array<int, 7> faces{};
  for (int i = 0; i < n; ++i) {
    const double u = random.uniform(), z = random.normal();
    ASSERT_TRUE(u >= 0 && u < 1);
    uniform += u;
    normal += z;
    square += z * z;
    ++faces[random.below(7)];
  }
  // Five standard deviations of each mean.
  EXPECT_NEAR(uniform / n, 0.5, 5 * std::sqrt(1.0 / 12 / n));
  EXPECT_NEAR(normal / n, 0, 5 / std::sqrt(n));
  EXPECT_NEAR(square / n, 1, 5 * std::sqrt(2.0 / n));
  for (const int count : faces) EXPECT_NEAR(count, n / 7.0, 5 * std::sqrt(n / 7.0));
}

TEST(Random, RotationsAreRotationsWithoutAPreferredDirection) {
  Random random(6);
  Eigen::Matrix3d mean = Eigen::Matrix3d::Zero();
  constexpr int n = 20000;
  for (int i = 0; i < n; ++i) {
    const Eigen::Matrix3d R = test::random_rotation(random);
    ASSERT_LE((R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff(), 1e-14);
    ASSERT_GT(R.row(0).cross(R.row(1)).dot(R.row(2)), 0.99);
    mean += R / n;
  }
  EXPECT_LE(mean.cwiseAbs().maxCoeff(), 5 * std::sqrt(1.0 / 3 / n));
}

TEST(Result, CodesHaveDistinctStableNames) {
  std::set<std::string_view> names;
  for (const ErrorCode code : {ErrorCode::invalid_argument, ErrorCode::bad_file, ErrorCode::io,
                               ErrorCode::unsupported, ErrorCode::internal})
    names.insert(name(code));
  EXPECT_EQ(names,
            (std::set<std::string_view>{"invalid_argument", "bad_file", "io", "unsupported", "internal"}));
}

TEST(Result, CarriesAValueOrAnError) {
  const auto half = [](int n) -> Result<int> {
    if (n % 2) return fail(ErrorCode::invalid_argument, std::to_string(n) + " is odd");
    return n / 2;
  };
  EXPECT_EQ(half(8).value(), 4);
  EXPECT_EQ(half(7).error().message, "7 is odd");
  EXPECT_EQ(half(7).error().code, ErrorCode::invalid_argument);
}

}  // namespace
}  // namespace bitr
