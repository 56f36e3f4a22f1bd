// Primitives, compounds and the shapes made of them.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "generate/aircraft.hpp"
#include "generate/compound.hpp"
#include "generate/field.hpp"
#include "generate/profile.hpp"
#include "generate/seeds.hpp"
#include "generate/solid.hpp"
#include "generate/vessels.hpp"
#include "statistics.hpp"

namespace bitr::generate {
namespace {

using Eigen::Vector3d;
using test::chi_square_excess;

constexpr double pi = std::numbers::pi;

std::unique_ptr<Primitive> ball(double radius, double x = 0) {
  std::vector<double> stations;
  for (int i = 0; i <= 24; ++i) stations.push_back(x - radius * std::cos(pi * i / 24));
  return std::make_unique<Loft>(
      Vector3d::UnitX(), Vector3d::UnitY(), Outline::round,
      [=](double along) {
        const double half = std::sqrt(std::max(0.0, radius * radius - (along - x) * (along - x)));
        return Section{.half_u = half, .half_v = half};
      },
      stations, 24);
}

std::unique_ptr<Primitive> cylinder(double radius, double length) {
  return std::make_unique<Loft>(
      Vector3d::UnitX(), Vector3d::UnitY(), Outline::round,
      [=](double) { return Section{.half_u = radius, .half_v = radius}; },
      even_steps(-length / 2, length / 2, 6), 20);
}

std::vector<SurfacePoint> points_of(const Shape& shape, std::size_t count, Random& random) {
  std::vector<SurfacePoint> points;
  while (points.size() < count) shape.trial(random, points);
  return points;
}

std::size_t bin(double share, std::size_t bins) {
  return std::min(bins - 1, static_cast<std::size_t>(std::max(0.0, share) * static_cast<double>(bins)));
}

TEST(Compound, BallIsUniformByArea) {
  Compound shape;
  shape.add(ball(2));
  shape.finish();
  Random random(1);
  std::vector<double> zones(20 * 20);  // bands of equal height have equal areas
  double radius = 0;
  for (const auto& [at, normal] : points_of(shape, 40'000, random)) {
    radius = radius == 0 ? at.norm() : radius;
    ASSERT_NEAR(at.norm(), radius, 1e-12);
    ASSERT_GT(normal.dot(at.normalized()), 1 - 1e-4);
    const double turn = std::atan2(at.y(), at.z()) / (2 * pi) + 0.5;
    zones[20 * bin((at.x() / radius + 1) / 2, 20) + bin(turn, 20)] += 1;
  }
  EXPECT_LT(chi_square_excess(zones, std::vector<double>(400, 1.0 / 400)), 5);
}

TEST(Compound, CylinderGetsItsSideAndEndsInProportion) {
  Compound shape;
  shape.add(cylinder(1, 3));
  shape.finish();
  Random random(2);
  const double side = 2 * pi * 3, end = pi;
  // Ten bands of the side, and five rings of equal area of each end.
  std::vector<double> counts(20), shares(20);
  for (int i = 0; i < 10; ++i) shares[i] = side / (side + 2 * end) / 10;
  for (int i = 10; i < 20; ++i) shares[i] = end / (side + 2 * end) / 5;
  double scale = 0;
  for (const auto& [at, normal] : points_of(shape, 40'000, random))
    scale = std::max(scale, std::abs(at.x()) / 1.5);
  for (const auto& [at, normal] : points_of(shape, 40'000, random)) {
    const Vector3d local = at / scale;
    const double from_axis = std::hypot(local.y(), local.z());
    if (std::abs(normal.x()) > 0.5)
      counts[(local.x() > 0 ? 10 : 15) + bin(from_axis * from_axis, 5)] += 1;
    else
      counts[bin(local.x() / 3 + 0.5, 10)] += 1;
  }
  EXPECT_LT(chi_square_excess(counts, shares), 5);
}

TEST(Compound, BentTubeHasMoreOfItsOuterSide) {
  // A quarter of a ring, which a cubic follows to 3e-4.
  constexpr double ring = 1, tube = 0.3, k = 0.5522847498;
  Compound shape;
  shape.add(std::make_unique<Bow>(Bow::Tube{.curve = {Vector3d(ring, 0, 0), Vector3d(ring, k * ring, 0),
                                                      Vector3d(k * ring, ring, 0), Vector3d(0, ring, 0)},
                                            .across = Vector3d::UnitZ(),
                                            .half_in = {tube, tube},
                                            .half_across = {tube, tube}}));
  shape.finish(Vector3d::Zero());
  Random random(3);
  const auto points = points_of(shape, 40'000, random);
  double scale = 0;
  for (const auto& [at, normal] : points) scale = std::max(scale, at.head<2>().norm() / (ring + tube));
  std::vector<double> counts(3);
  for (const auto& [at, normal] : points) {
    const Vector3d local = at / scale;
    if (std::min(local.x(), local.y()) < 1e-4)
      counts[2] += 1;
    else
      counts[local.head<2>().norm() < ring] += 1;
  }
  const double quarter = pi * pi * ring * tube, bend = pi * tube * tube;  // so much more outside, less inside
  const double total = quarter + 2 * pi * tube * tube;
  EXPECT_LT(chi_square_excess(counts, {(quarter / 2 + bend) / total, (quarter / 2 - bend) / total,
                                       2 * pi * tube * tube / total}),
            5);
}

TEST(Compound, UnionHasOnlyItsOuterSurface) {
  // Balls of radius 1 around 0 and 0.7 around 1: they meet where x = (1 + 1 − 0.49) / 2.
  const double meet = (1 + 1 - 0.49) / 2, first = 2 * pi * (meet + 1), second = 2 * pi * 0.7 * (1.7 - meet);
  Compound shape;
  shape.add(ball(1));
  shape.add(ball(0.7, 1));
  shape.finish(Vector3d::Zero());
  Random random(4);
  const auto points = points_of(shape, 40'000, random);
  double scale = 0;
  for (const auto& point : points) scale = std::max(scale, -point.position.x());
  std::vector<double> counts(2);
  for (const auto& [at, normal] : points) {
    const Vector3d local = at / scale;
    const bool on_first = std::abs(local.norm() - 1) < 2e-3 && local.x() <= meet + 2e-3;
    if (!on_first) {
      ASSERT_NEAR((local - Vector3d::UnitX()).norm(), 0.7, 2e-3);
      ASSERT_GE(local.x(), meet - 2e-3);
    }
    counts[!on_first] += 1;
  }
  EXPECT_LT(chi_square_excess(counts, {first / (first + second), second / (first + second)}), 5);
}

TEST(Compound, CavityIsSurfaceToo) {
  Compound shape;
  shape.add(ball(1));
  shape.take_away(ball(0.6));
  shape.finish();
  Random random(5);
  std::vector<double> counts(2);
  for (const auto& [at, normal] : points_of(shape, 20'000, random)) {
    const bool outer = at.norm() > 0.4;
    counts[!outer] += 1;
    EXPECT_GT(normal.dot(at.normalized()) * (outer ? 1 : -1), 1 - 1e-3);
    EXPECT_TRUE(shape.inside(at - 1e-3 * normal));
    EXPECT_FALSE(shape.inside(at + 1e-3 * normal));
  }
  EXPECT_FALSE(shape.inside(Vector3d::Zero()));
  EXPECT_LT(chi_square_excess(counts, {1 / 1.36, 0.36 / 1.36}), 5);
}

TEST(FieldShape, SamplesAsTheFieldAlone) {
  const Vector3d half(0.4, 0.2, 0.1);
  const FieldShape box([&](const Vector3d& at) { return (at.cwiseAbs() - half).maxCoeff(); });
  Random random(6);
  std::vector<double> counts(6), shares(6);
  std::size_t trials = 0;
  std::vector<SurfacePoint> points;
  for (; points.size() < 40'000; ++trials) box.trial(random, points);
  for (const auto& [at, normal] : points) {
    int axis = 0;
    ASSERT_NEAR((at.cwiseAbs() - half).maxCoeff(&axis), 0, 1e-11);
    counts[2 * axis + (at[axis] > 0)] += 1;
  }
  const double area = 8 * (half.x() * half.y() + half.y() * half.z() + half.z() * half.x());
  for (int face = 0; face < 6; ++face) shares[face] = 4 * half.prod() / half[face / 2] / area;
  EXPECT_LT(chi_square_excess(counts, shares), 5);
  // The area itself, from the number of trials.
  EXPECT_NEAR(box.weight() * 40'000 / static_cast<double>(trials), area, 0.02 * area);
}

TEST(Profile, GoesThroughItsKnotsAndNeverBeyond) {
  const Profile profile({{0, 1}, {0.2, 1.5}, {0.7, 0.4}, {0.9, 0.4}, {1, 2}});
  EXPECT_DOUBLE_EQ(profile(0.2), 1.5);
  EXPECT_DOUBLE_EQ(profile(0.7), 0.4);
  EXPECT_DOUBLE_EQ(profile(-1), 1);
  EXPECT_DOUBLE_EQ(profile(3), 2);
  for (double at = 0.001; at < 0.999; at += 0.001) {
    EXPECT_GE(profile(at), 0.4 - 1e-12);
    EXPECT_LE(profile(at), at < 0.8 ? 1.5 : 2);
    EXPECT_NEAR(profile.slope(at), (profile(at + 1e-6) - profile(at - 1e-6)) / 2e-6, 1e-3);
  }
}

struct Maker {
  const char* name;
  std::unique_ptr<Shape> (*make)(Random&);
};
constexpr Maker makers[] = {
    {"aircraft", random_aircraft}, {"vessels", random_vessel}, {"solids", random_solid_shape}};

TEST(Shapes, SurfaceIsClosedAndBoundsWhatIsInside) {
  for (const Maker& maker : makers)
    for (std::uint64_t seed = 0; seed < 24; ++seed) {
      SCOPED_TRACE(std::string(maker.name) + " " + std::to_string(seed));
      Random random = random_for(seed, Draw::shape);
      const auto shape = maker.make(random);
      std::vector<SurfacePoint> points;
      std::size_t trials = 0;
      for (; points.size() < 8000; ++trials) shape->trial(random, points);

      // A closed surface's normals cancel, and its area times the mean of at · normal is three times its
      // volume.
      const auto count = static_cast<double>(points.size());
      const double area = shape->weight() * count / static_cast<double>(trials);
      Vector3d mean = Vector3d::Zero();
      double volume = 0;
      std::size_t thin = 0;
      for (const auto& [at, normal] : points) {
        ASSERT_LE(at.norm(), solid_radius);
        ASSERT_NEAR(normal.norm(), 1, 1e-6);
        mean += normal / count;
        volume += area * at.dot(normal) / 3 / count;
        // Nothing but air outside and nothing but matter inside, except near edges and creases.
        thin += shape->inside(at + 2e-5 * normal) || !shape->inside(at - 2e-5 * normal);
      }
      EXPECT_LT(mean.norm(), 5 / std::sqrt(count));
      EXPECT_LT(static_cast<double>(thin), 0.01 * count);

      std::size_t within = 0;
      const std::size_t darts = 60'000;
      for (std::size_t i = 0; i < darts; ++i)
        within += shape->inside(
            Vector3d(random.uniform(-0.5, 0.5), random.uniform(-0.5, 0.5), random.uniform(-0.5, 0.5)));
      const double share = static_cast<double>(within) / static_cast<double>(darts);
      const double spread = std::sqrt(share / static_cast<double>(darts)) + area * 0.3 / 3 / std::sqrt(count);
      EXPECT_NEAR(volume, share, 5 * spread);
    }
}

TEST(Shapes, VesselsAreAsSymmetricAsTheySay) {
  std::size_t any_turn = 0, half_turn = 0, none = 0;
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    Random random = random_for(seed, Draw::shape);
    const auto vessel = random_vessel(random);
    const Symmetry symmetry = vessel->symmetry();
    EXPECT_EQ(symmetry.axis, (Vec3d{0, 0, 1}));
    (symmetry.order == 0 ? any_turn : symmetry.order == 2 ? half_turn : none) += 1;
    // Points a little outside and inside stay there when they are turned.
    const auto turned_wrong = [&](double angle) {
      const Eigen::AngleAxisd turn(angle, Vector3d::UnitZ());
      Random draw(seed);
      std::size_t wrong = 0;
      for (const auto& [at, normal] : points_of(*vessel, 2000, draw)) {
        const Vector3d out = at + 1e-4 * normal, in = at - 1e-4 * normal;
        wrong += vessel->inside(turn * out) != vessel->inside(out) ||
                 vessel->inside(turn * in) != vessel->inside(in);
      }
      return static_cast<double>(wrong) / 2000;
    };
    if (symmetry.order == 0) {
      EXPECT_LT(turned_wrong(1), 0.005) << seed;
    }
    if (symmetry.order == 2) {
      EXPECT_LT(turned_wrong(pi), 0.005) << seed;
    }
    if (symmetry.order != 0) {
      EXPECT_GT(turned_wrong(1), 0.02) << seed;
    }
    if (symmetry.order == 1) {
      EXPECT_GT(turned_wrong(pi), 0.02) << seed;
    }
  }
  EXPECT_GT(any_turn, 10u);
  EXPECT_GT(half_turn, 2u);
  EXPECT_GT(none, 10u);
}

TEST(Shapes, AircraftHaveAMirrorImageAndDifferentEnds) {
  for (std::uint64_t seed = 0; seed < 30; ++seed) {
    Random random = random_for(seed, Draw::shape);
    const auto aircraft = random_aircraft(random);
    std::size_t mirrored = 0, above = 0, behind = 0;
    for (const auto& [at, normal] : points_of(*aircraft, 4000, random)) {
      const Vector3d in = at - 1e-4 * normal;
      mirrored += aircraft->inside({in.x(), -in.y(), in.z()}) == aircraft->inside(in);
      above += aircraft->inside({in.x(), in.y(), -in.z()}) == aircraft->inside(in);
      behind += aircraft->inside({-in.x(), in.y(), in.z()}) == aircraft->inside(in);
    }
    // Propellers turn the same way on both sides.
    EXPECT_GT(mirrored, 3400u) << seed;
    EXPECT_LT(above, 3200u) << seed;
    EXPECT_LT(behind, 3000u) << seed;
    EXPECT_EQ(aircraft->symmetry().order, 1u);
  }
}

}  // namespace
}  // namespace bitr::generate
