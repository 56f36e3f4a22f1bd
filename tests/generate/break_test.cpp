// Shapes broken in two: both fragments are closed, and fit.
#include <gtest/gtest.h>

#include <cmath>

#include "generate/aircraft.hpp"
#include "generate/break.hpp"
#include "generate/pairs.hpp"
#include "generate/seeds.hpp"
#include "generate/solid.hpp"
#include "generate/vessels.hpp"

namespace bitr::generate {
namespace {

using Eigen::Vector3d;

Vector3d position(const PointCloud& cloud, std::size_t i) { return Vector3d(cloud.positions[i].data()); }
Vector3d normal(const PointCloud& cloud, std::size_t i) {
  return Eigen::Map<const Eigen::Vector3f>(cloud.normals[i].data()).cast<double>();
}

TEST(Relief, SlopeIsItsGradient) {
  Random random(7);
  const Relief relief(0.05, random);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector2d at(random.uniform(-0.5, 0.5), random.uniform(-0.5, 0.5)), slope = relief.slope(at);
    for (int axis = 0; axis < 2; ++axis) {
      const Eigen::Vector2d step = 1e-6 * Eigen::Vector2d::Unit(axis);
      EXPECT_NEAR(slope[axis], (relief.height(at + step) - relief.height(at - step)) / 2e-6, 1e-4);
    }
  }
}

TEST(Break, FragmentsAreClosedAndShareTheBreak) {
  struct Maker {
    const char* name;
    std::unique_ptr<Shape> (*make)(Random&);
  };
  for (const Maker& maker : {Maker{"vessels", random_vessel}, {"solids", random_solid_shape}})
    for (std::uint64_t seed = 0; seed < 10; ++seed) {
      SCOPED_TRACE(std::string(maker.name) + " " + std::to_string(seed));
      Random random = random_for(seed, Draw::shape);
      const auto whole = maker.make(random);
      Break crack(0.02, random);
      crack.divide(sample(*whole, 500, random), 0.5);
      constexpr std::size_t count = 6000;
      const Fragments fragments = sample_fragments(*whole, crack, count, random);

      double break_share[2], area[2];
      for (const bool above : {false, true}) {
        const PointCloud& cloud = above ? fragments.above : fragments.below;
        ASSERT_EQ(cloud.size(), count);
        Vector3d mean = Vector3d::Zero();
        std::size_t broken = 0;
        for (std::size_t i = 0; i < count; ++i) {
          const Vector3d at = position(cloud, i), out = normal(cloud, i);
          mean += out / count;
          const double side = crack(at) * (above ? 1 : -1);
          if (std::abs(side) < 1e-9) {
            ++broken;
            // On the break: the whole is on both sides, this fragment on one.
            ASSERT_TRUE(whole->inside(at));
            EXPECT_LT((crack(at + 1e-4 * out) - crack(at - 1e-4 * out)) * (above ? 1 : -1), 0);
          } else {
            ASSERT_GT(side, 0);
          }
        }
        EXPECT_LT(mean.norm(), 5 / std::sqrt(count));
        break_share[above] = static_cast<double>(broken) / count;
        EXPECT_GT(broken, 50u);
        // Half of the whole's surface, or so, and the break.
        area[above] = 1 / (1 - break_share[above]);
      }
      // The same break: its area is the same share of both, once the whole's surface is divided evenly.
      const double ratio = break_share[1] * area[1] / (break_share[0] * area[0]);
      EXPECT_GT(ratio, 0.7);
      EXPECT_LT(ratio, 1.4);
    }
}

TEST(Break, BothSidesOfItCoincideUnderTheTruth) {
  for (const char* kind : {"vessels", "fragments"})
    for (std::uint64_t seed = 0; seed < 4; ++seed) {
      SCOPED_TRACE(std::string(kind) + " " + std::to_string(seed));
      const GeneratedPair pair = generate_pair(kind, {.points = 6000, .seed = seed}).value();
      EXPECT_EQ(pair.overlap, 0);
      // Points of the source whose nearest reference point faces them are on the break. How far apart they
      // are is the sampling's, not the break's: off its surface the distance is far smaller.
      std::size_t facing = 0;
      double off = 0, apart = 0;
      for (std::size_t i = 0; i < pair.source.size(); ++i) {
        const Vec3d moved = pair.T_reference_source.apply(pair.source.positions[i]);
        const Vec3f& n = pair.source.normals[i];
        const Vec3d turned = pair.T_reference_source.rotate({n[0], n[1], n[2]});
        const Vector3d at(moved.data()), out(turned.data());
        double nearest = 1;
        std::size_t found = 0;
        for (std::size_t j = 0; j < pair.reference.size(); ++j) {
          const double distance = (position(pair.reference, j) - at).squaredNorm();
          if (distance < nearest) {
            nearest = distance;
            found = j;
          }
        }
        if (nearest > 0.01 * 0.01 || normal(pair.reference, found).dot(out) > -0.9) continue;
        ++facing;
        off += std::abs((position(pair.reference, found) - at).dot(out));
        apart += std::sqrt(nearest);
      }
      EXPECT_GT(facing, 60u);
      EXPECT_LT(off / static_cast<double>(facing), 0.0012);
      EXPECT_LT(off, 0.3 * apart);
    }
}

}  // namespace
}  // namespace bitr::generate
