#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "generate/field.hpp"
#include "generate/relief.hpp"
#include "generate/solid.hpp"

namespace bitr::generate {
namespace {

using Eigen::Vector3d;

TEST(SampleSurface, BoxFacesGetPointsInProportionToTheirArea) {
  const Vector3d half(0.4, 0.2, 0.1);
  const Field box = [&](const Vector3d& at) { return (at.cwiseAbs() - half).maxCoeff(); };
  Random random(1);
  const std::size_t count = 40'000;
  const PointCloud cloud = sample_surface(box, 0.5, count, random);
  ASSERT_EQ(cloud.size(), count);
  ASSERT_EQ(cloud.normals.size(), count);

  double on_face[6] = {};
  for (std::size_t i = 0; i < count; ++i) {
    const Vector3d at(cloud.positions[i].data());
    EXPECT_LT(std::abs(box(at)), 1e-11);
    int axis = 0;
    (at.cwiseAbs() - half).maxCoeff(&axis);
    const double side = at[axis] > 0 ? 1 : -1;
    EXPECT_NEAR(cloud.normals[i][axis] * side, 1, 1e-3);
    on_face[2 * axis + (side > 0)] += 1;
  }
  const double total_area = 8 * (half.x() * half.y() + half.y() * half.z() + half.z() * half.x());
  for (int face = 0; face < 6; ++face) {
    const int axis = face / 2;
    const double share = 4 * half[(axis + 1) % 3] * half[(axis + 2) % 3] / total_area;
    const double deviation = std::sqrt(static_cast<double>(count) * share);
    EXPECT_NEAR(on_face[face], static_cast<double>(count) * share, 5 * deviation) << "face " << face;
  }
}

TEST(Solid, FieldNeverExceedsTheDistanceAndStaysInItsBall) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Random random(seed);
    const Solid solid = random_solid(random);
    for (int i = 0; i < 500; ++i) {
      const Vector3d a = 0.7 * Vector3d::NullaryExpr([&] { return random.uniform(-1, 1); });
      const Vector3d b = a + 0.05 * Vector3d::NullaryExpr([&] { return random.uniform(-1, 1); });
      EXPECT_LE(std::abs(solid(a) - solid(b)), (a - b).norm() * (1 + 1e-12));
    }
    for (const Vec3d& point : sample_surface(solid, 1.0, 500, random).positions)
      EXPECT_LE(Vector3d(point.data()).norm(), solid_radius);
  }
}

TEST(Relief, WavesHaveTheirDeviationAndFewPlacesAreSteep) {
  const double deviation = 0.03;
  const int samples = 20'000;
  // The same draws at two roughnesses differ by the waves alone, without the curved base.
  Random random(3), same(3), points(4);
  const Relief rough(deviation, random), smooth(0, same);
  double square = 0;
  int steep = 0;
  for (int i = 0; i < samples; ++i) {
    const Eigen::Vector2d anywhere(points.uniform(-50, 50), points.uniform(-50, 50));
    const double wave = rough.height(anywhere) - smooth.height(anywhere);
    square += wave * wave / samples;

    const Eigen::Vector2d near(points.uniform(-0.35, 0.35), points.uniform(-0.35, 0.35));
    steep += rough.slope(near).norm() > rough.steep(0.5);
  }
  EXPECT_LT(steep, samples / 200);
  EXPECT_NEAR(std::sqrt(square), deviation, 0.05 * deviation);
}

TEST(Asymmetry, IsZeroForSymmetricCloudsOnly) {
  Random random(4);
  const Vector3d half(0.4, 0.2, 0.1);
  const Field box = [&](const Vector3d& at) { return (at.cwiseAbs() - half).maxCoeff(); };
  PointCloud cloud = sample_surface(box, 0.5, 2000, random);
  // Every half-turn of the box, so that the sample itself is symmetric.
  const auto points = cloud.positions;
  for (const Vec3d& p : points)
    cloud.positions.insert(cloud.positions.end(),
                           {{p[0], -p[1], -p[2]}, {-p[0], p[1], -p[2]}, {-p[0], -p[1], p[2]}});
  EXPECT_NEAR(asymmetry(cloud), 0, 1e-12);

  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Random draw(seed);
    EXPECT_GE(asymmetry(interior(random_solid(draw))), 0.1) << seed;
  }
}

}  // namespace
}  // namespace bitr::generate
