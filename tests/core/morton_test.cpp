#include "core/morton.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "core/random.hpp"

namespace bitr {
namespace {

std::vector<Vec3d> random_points(Random& random, std::size_t count) {
  std::vector<Vec3d> points(count);
  for (Vec3d& p : points) p = {random.uniform(-3, 5), random.uniform(100, 101), random.uniform(-1e-3, 0)};
  return points;
}

std::vector<Vec3d> ordered(const std::vector<Vec3d>& points) {
  std::vector<Vec3d> result;
  for (const std::uint32_t i : morton_order(points.size(), [&](std::size_t p) { return points[p]; }))
    result.push_back(points[i]);
  return result;
}

double length(const std::vector<Vec3d>& path) {
  double sum = 0;
  for (std::size_t i = 1; i < path.size(); ++i)
    sum += std::hypot(path[i][0] - path[i - 1][0], path[i][1] - path[i - 1][1], path[i][2] - path[i - 1][2]);
  return sum;
}

TEST(Morton, SpreadsBits) {
  EXPECT_EQ(every_third_bit(0), 0u);
  EXPECT_EQ(every_third_bit(1), 1u);
  EXPECT_EQ(every_third_bit(0b1011), 0b1000001001u);
  for (int bit = 0; bit < 21; ++bit)
    EXPECT_EQ(every_third_bit(std::uint64_t{1} << bit), std::uint64_t{1} << 3 * bit);
  EXPECT_EQ(every_third_bit((1 << 21) - 1), 0x1249249249249249u);
}

TEST(Morton, VisitsEveryPointOnceAndNeighboursTogether) {
  Random random(1);
  const std::vector<Vec3d> points = random_points(random, 2000);
  auto order = morton_order(points.size(), [&](std::size_t i) { return points[i]; });
  EXPECT_LT(length(ordered(points)), 0.1 * length(points));
  std::sort(order.begin(), order.end());
  std::vector<std::uint32_t> all(points.size());
  std::iota(all.begin(), all.end(), 0u);
  EXPECT_EQ(order, all);
}

TEST(Morton, ForgetsTheOrderOfPoints) {
  Random random(2);
  for (const std::size_t count : {1, 2, 9, 500}) {
    std::vector<Vec3d> points = random_points(random, count);
    // Some share a cell: they differ by less than its side.
    for (std::size_t i = 1; i < count; i += 3)
      points[i] = {points[i - 1][0], points[i - 1][1], points[i - 1][2] + 1e-9};
    const std::vector<Vec3d> expected = ordered(points);
    for (std::size_t i = count; i > 1; --i) std::swap(points[i - 1], points[random.below(i)]);
    EXPECT_EQ(ordered(points), expected);
  }
}

TEST(Morton, EqualPointsKeepTheirOrder) {
  const std::vector<Vec3d> points(5, Vec3d{1, 2, 3});
  EXPECT_EQ(morton_order(5, [&](std::size_t i) { return points[i]; }),
            (std::vector<std::uint32_t>{0, 1, 2, 3, 4}));
  EXPECT_TRUE(morton_order(0, [&](std::size_t i) { return points[i]; }).empty());
}

}  // namespace
}  // namespace bitr
