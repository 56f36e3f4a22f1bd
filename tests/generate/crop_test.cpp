#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bitr/generate.hpp>
#include <cmath>
#include <set>

#include "core/random.hpp"

namespace bitr {
namespace {

using testing::HasSubstr;

PointCloud cloud_of(std::size_t count, std::uint64_t seed = 1) {
  return generate_shape("solids", seed, count).value().cloud;
}

/// A cloud of the pair in the object's frame.
std::vector<Vec3d> in_object(const GeneratedPair& pair, bool reference) {
  const Pose T_object_cloud =
      reference ? (pair.T_reference_source * pair.T_source_object).inverse() : pair.T_source_object.inverse();
  std::vector<Vec3d> points = (reference ? pair.reference : pair.source).positions;
  for (Vec3d& point : points) point = T_object_cloud.apply(point);
  return points;
}

/// Which of the object's points a cloud of the pair has.
std::set<std::size_t> members(const PointCloud& object, const std::vector<Vec3d>& points) {
  std::set<std::size_t> found;
  for (const Vec3d& point : points)
    for (std::size_t i = 0; i < object.size(); ++i) {
      const Vec3d& at = object.positions[i];
      if (std::hypot(point[0] - at[0], point[1] - at[1], point[2] - at[2]) < 1e-12) found.insert(i);
    }
  return found;
}

TEST(Crop, SidesKeepTheirSharesAndOverlapAsStated) {
  const PointCloud cloud = cloud_of(1000);
  for (const ProtocolName& protocol : protocols())
    for (const double share : {0.3, 0.5, 0.7, 0.9})
      for (std::uint64_t seed = 0; seed < 3; ++seed) {
        SCOPED_TRACE(std::string(protocol.name) + " " + std::to_string(share));
        const GeneratedPair pair =
            crop_pair(cloud, {.protocol = protocol.protocol, .share = share, .seed = seed}).value();
        const bool complement = protocol.protocol == Protocol::complement;
        EXPECT_EQ(pair.reference.size(), std::round(1000 * share));
        EXPECT_EQ(pair.source.size(), std::round(1000 * (complement ? 1 - share : share)));
        EXPECT_EQ(pair.source.normals.size(), pair.source.size());

        const auto a = members(cloud, in_object(pair, false)), b = members(cloud, in_object(pair, true));
        ASSERT_EQ(a.size(), pair.source.size());
        ASSERT_EQ(b.size(), pair.reference.size());
        std::vector<std::size_t> both;
        std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(both));
        const double measured = static_cast<double>(both.size()) / 1000;
        EXPECT_NEAR(pair.overlap, measured, 1e-12);
        const double least = std::max(0.0, 2 * share - 1);
        if (complement) {
          EXPECT_EQ(measured, 0);
        } else if (protocol.protocol == Protocol::opposed) {
          EXPECT_NEAR(measured, least, 1e-12);
        } else {
          EXPECT_GE(measured, least - 1e-12);
        }
      }
}

TEST(Crop, IndependentOverlapVariesWithThePlanes) {
  const PointCloud cloud = cloud_of(500);
  double low = 1, high = 0, mean = 0;
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const double overlap =
        crop_pair(cloud, {.protocol = Protocol::independent, .share = 0.6, .seed = seed}).value().overlap;
    low = std::min(low, overlap);
    high = std::max(high, overlap);
    mean += overlap / 200;
  }
  EXPECT_LT(low, 0.26);
  EXPECT_GT(high, 0.52);
  EXPECT_NEAR(mean, 0.36, 0.06);  // s² if the planes had nothing to do with the shape
}

TEST(Crop, TwoSamplesOverlapAsStatedAndNeverWhereTheyShouldNot) {
  const PointCloud both = cloud_of(4000);
  PointCloud a, b;
  a.positions.assign(both.positions.begin(), both.positions.begin() + 2000);
  b.positions.assign(both.positions.begin() + 2000, both.positions.end());
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const GeneratedPair opposed = crop_pair(a, b, {.share = 0.7, .seed = seed}).value();
    EXPECT_EQ(opposed.source.size(), 1400u);
    EXPECT_EQ(opposed.reference.size(), 1400u);
    EXPECT_NEAR(opposed.overlap, 0.4, 0.03);
    for (const CropOptions& options :
         {CropOptions{.share = 0.5, .seed = seed},
          CropOptions{.protocol = Protocol::complement, .share = 0.6, .seed = seed}}) {
      const GeneratedPair pair = crop_pair(a, b, options).value();
      EXPECT_EQ(pair.overlap, 0);
      const double reference_share = options.share, source_share = options.share == 0.5 ? 0.5 : 0.4;
      EXPECT_LE(static_cast<double>(pair.source.size()), 2000 * source_share);
      EXPECT_GE(static_cast<double>(pair.source.size()), 2000 * source_share - 60);
      EXPECT_LE(static_cast<double>(pair.reference.size()), 2000 * reference_share);
      EXPECT_GE(static_cast<double>(pair.reference.size()), 2000 * reference_share - 60);
    }
  }
}

TEST(Crop, NoiseIsClipped) {
  const PointCloud cloud = cloud_of(3000);
  const CropOptions clean{.share = 1, .seed = 4};
  CropOptions noisy = clean;
  noisy.noise = 0.01;
  noisy.clip = 1.5;
  const auto a = in_object(crop_pair(cloud, clean).value(), false),
             b = in_object(crop_pair(cloud, noisy).value(), false);
  double square = 0;
  std::size_t clipped = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    for (int axis = 0; axis < 3; ++axis) {
      const double moved = std::abs(a[i][axis] - b[i][axis]);
      ASSERT_LE(moved, 0.015 + 1e-12);
      clipped += moved > 0.015 - 1e-9;
      square += moved * moved / 9000;
    }
  // A standard normal has 13.36 % beyond 1.5; cut there, its variance is 0.7785.
  EXPECT_NEAR(static_cast<double>(clipped) / 9000, 0.1336, 0.015);
  EXPECT_NEAR(std::sqrt(square), 0.01 * std::sqrt(0.7785), 2e-4);
}

TEST(Crop, PosesAreUniformWithinTheirRangeAndNormalsCanBeDropped) {
  const PointCloud cloud = cloud_of(100);
  double farthest = 0, mean_angle = 0;
  const Pose identity;
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    const GeneratedPair pair = crop_pair(cloud, {.translation = 0.3, .normals = false, .seed = seed}).value();
    EXPECT_TRUE(pair.source.normals.empty());
    EXPECT_TRUE(pair.reference.normals.empty());
    for (const double t : pair.T_source_object.translation) {
      ASSERT_LE(std::abs(t), 0.3);
      farthest = std::max(farthest, std::abs(t));
    }
    mean_angle += rotation_error_degrees(identity, pair.T_source_object) / 300;
  }
  EXPECT_GT(farthest, 0.29);
  EXPECT_NEAR(mean_angle, 126.5, 6);  // π/2 + 2/π, of a uniform rotation
}

TEST(Crop, RepeatsForItsSeed) {
  const PointCloud cloud = cloud_of(200);
  const CropOptions options{.protocol = Protocol::independent, .noise = 0.01, .seed = 9};
  const GeneratedPair a = crop_pair(cloud, options).value(), b = crop_pair(cloud, options).value();
  EXPECT_EQ(a.source.positions, b.source.positions);
  EXPECT_EQ(a.reference.positions, b.reference.positions);
  EXPECT_EQ(a.T_reference_source.matrix(), b.T_reference_source.matrix());
  CropOptions other = options;
  other.seed = 10;
  EXPECT_NE(a.source.positions, crop_pair(cloud, other).value().source.positions);
}

TEST(Crop, ProtocolsHaveNames) {
  for (const ProtocolName& protocol : protocols()) {
    EXPECT_EQ(protocol_named(protocol.name).value(), protocol.protocol);
    EXPECT_EQ(name(protocol.protocol), protocol.name);
  }
  EXPECT_THAT(protocol_named("random").error().message, HasSubstr("known: opposed, complement, independent"));
}

TEST(Crop, RefusesWhatIsOutOfRange) {
  const PointCloud cloud = cloud_of(10);
  const auto message = [](const PointCloud& of, const CropOptions& options) {
    const auto pair = crop_pair(of, options);
    EXPECT_FALSE(pair.has_value());
    return pair ? std::string() : pair.error().message;
  };
  EXPECT_THAT(message(cloud, {.share = 0}), HasSubstr("share is 0"));
  EXPECT_THAT(message(cloud, {.share = 1.1}), HasSubstr("share is 1.1"));
  EXPECT_THAT(message(cloud, {.share = std::nan("")}), HasSubstr("share"));
  EXPECT_THAT(message(cloud, {.protocol = Protocol::complement, .share = 1}), HasSubstr("share is 1"));
  EXPECT_THAT(message(cloud, {.noise = -1}), HasSubstr("noise"));
  EXPECT_THAT(message(cloud, {.clip = 0}), HasSubstr("clip"));
  EXPECT_THAT(message(cloud, {.translation = -1}), HasSubstr("translation"));
  EXPECT_THAT(message({}, {}), HasSubstr("0 points"));
  PointCloud one_place;
  one_place.positions.assign(10, Vec3d{1, 2, 3});
  EXPECT_THAT(message(one_place, {.share = 0.5}), HasSubstr("one place"));
}

}  // namespace
}  // namespace bitr
