#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bitr/picture.hpp>
#include <cmath>
#include <ctime>
#include <numbers>

#include "core/random.hpp"
#include "picture/camera.hpp"
#include "picture/captions.hpp"
#include "picture/scene.hpp"
#include "support/random_motion.hpp"
#include "support/shapes.hpp"

namespace bitr::picture {
namespace {

using Eigen::Vector3d, Eigen::Vector3f;
using testing::HasSubstr;

constexpr std::array<double, 9> along_z = {1, 0, 0, 0, 1, 0, 0, 0, 1};

PointCloud cloud_of(std::vector<Vec3d> positions) {
  PointCloud cloud;
  cloud.positions = std::move(positions);
  return cloud;
}

/// A square of one unit, `n` × `n` points, at a height.
PointCloud sheet(double z, int n = 60) {
  PointCloud cloud;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) cloud.positions.push_back({(i + 0.5) / n, (j + 0.5) / n, z});
  return cloud;
}

PointCloud sphere(std::size_t count, bool normals) {
  Random random(3);
  PointCloud cloud;
  for (std::size_t i = 0; i < count; ++i) {
    const double z = random.uniform(-1, 1), turn = random.uniform(0, 2 * std::numbers::pi);
    const double across = std::sqrt(1 - z * z);
    cloud.positions.push_back({across * std::cos(turn), across * std::sin(turn), z});
    const Vec3d& p = cloud.positions.back();
    if (normals)
      cloud.normals.push_back({static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])});
  }
  return cloud;
}

PointCloud moved(PointCloud cloud, const Pose& pose) {
  for (Vec3d& point : cloud.positions) point = pose.apply(point);
  return cloud;
}

enum class Paint { white, orange, blue, other };

Paint paint_at(const Image& image, int x, int y) {
  const std::uint8_t* pixel = &image.rgb[3 * (static_cast<std::size_t>(y) * image.width + x)];
  const int r = pixel[0], g = pixel[1], b = pixel[2];
  if (r == 255 && g == 255 && b == 255) return Paint::white;
  if (r > b + 20) return Paint::orange;
  if (b > r + 20) return Paint::blue;
  return Paint::other;
}

Paint paint_at(const Image& image, const Vector3f& at) {
  return paint_at(image, static_cast<int>(at[0]), static_cast<int>(at[1]));
}

struct Painted {
  int count = 0;
  double x = 0, y = 0;  ///< mean place
};

Painted painted(const Image& image, const Scene& scene, int panel, Paint paint) {
  Painted sum;
  const Panel& where = scene.panels[panel];
  for (int y = 0; y < image.height - scene.caption_height; ++y) {
    for (int x = where.left; x < where.left + where.width; ++x) {
      if (paint_at(image, x, y) != paint) continue;
      ++sum.count;
      sum.x += x;
      sum.y += y;
    }
  }
  sum.x /= sum.count;
  sum.y /= sum.count;
  return sum;
}

struct Drawn {
  Drawn(const PointCloud& source, const PointCloud& reference, const Assembly& assembly = {},
        const PictureOptions& options = {.view = along_z})
      : scene(source, reference, assembly, options),
        image(render_picture(source, reference, assembly, options).value()) {}
  Painted of(int panel, Paint paint) const { return painted(image, scene, panel, paint); }
  Scene scene;
  Image image;
};

TEST(Picture, EveryPanelHasItsColours) {
  Random random(1);
  const Drawn drawn(test::random_cloud(random, 1000), test::random_cloud(random, 800));
  EXPECT_EQ(drawn.image.rgb.size(), 3u * 1920 * 520);
  EXPECT_GT(drawn.of(0, Paint::orange).count, 3000);
  EXPECT_EQ(drawn.of(0, Paint::blue).count, 0);
  EXPECT_GT(drawn.of(1, Paint::blue).count, 3000);
  EXPECT_EQ(drawn.of(1, Paint::orange).count, 0);
  for (const int panel : {2, 3}) {
    EXPECT_GT(drawn.of(panel, Paint::orange).count, 1000);
    EXPECT_GT(drawn.of(panel, Paint::blue).count, 1000);
  }
}

TEST(Picture, PointsAreWhereTheyBelong) {
  // Right, up, towards the viewer; the middle is empty.
  const PointCloud cross = cloud_of({{-1, 0, 0}, {1, 0, 0}, {0, -0.5, 0}, {0, 0.5, 0}});
  const Drawn drawn(cross, cross);
  const Panel& panel = drawn.scene.panels[0];
  std::vector<Vector3f> at;
  for (const Vector3f& point : drawn.scene.source.points) at.push_back(drawn.scene.project(panel, point));
  for (const Vector3f& place : at) EXPECT_EQ(paint_at(drawn.image, place), Paint::orange);
  EXPECT_EQ(paint_at(drawn.image, Vector3f((at[0] + at[1]) / 2)), Paint::white);
  EXPECT_LT(at[0][0] + 20, at[1][0]);
  EXPECT_GT(at[2][1], at[3][1] + 20);
  EXPECT_NEAR((at[1][0] - at[0][0]) / (at[2][1] - at[3][1]), 2, 1e-3);
  EXPECT_NEAR(at[1][0] - at[0][0], 2 / drawn.scene.length * drawn.scene.scale, 0.01);
  const int orange = drawn.of(0, Paint::orange).count;
  EXPECT_GT(orange, 4 * 20);
  EXPECT_LT(orange, 4 * 200) << "four small discs";
}

TEST(Picture, NearerPointsHideFartherOnes) {
  const PointCloud low = sheet(0), high = sheet(0.2);
  const Drawn source_above(high, low), reference_above(low, high);
  EXPECT_EQ(source_above.of(3, Paint::blue).count, 0);
  EXPECT_GT(source_above.of(3, Paint::orange).count, 10000);
  EXPECT_EQ(reference_above.of(3, Paint::orange).count, 0);
  EXPECT_GT(reference_above.of(3, Paint::blue).count, 10000);
}

TEST(Picture, SurfacesThatCoincideShowBoth) {
  const Drawn drawn(sheet(0), sheet(0));
  const int orange = drawn.of(3, Paint::orange).count, blue = drawn.of(3, Paint::blue).count;
  EXPECT_GT(orange, (orange + blue) / 4);
  EXPECT_GT(blue, (orange + blue) / 4);
}

TEST(Picture, MovingTheSourceMovesIt) {
  const PointCloud source = sheet(0), reference = sheet(-1);
  const auto offset = [](const Drawn& drawn, int panel) {
    const Painted orange = drawn.of(panel, Paint::orange), blue = drawn.of(panel, Paint::blue);
    return std::pair(orange.x - blue.x, orange.y - blue.y);
  };
  const Pose right = {along_z, {1.05, 0, 0}}, up = {along_z, {0, 1.05, 0}};
  for (const bool by_pose : {false, true}) {
    const int panel = by_pose ? 3 : 2;
    const auto drawn = [&](const Pose& pose) {
      Assembly assembly;
      if (by_pose) assembly.T_reference_source = pose;
      return Drawn(by_pose ? source : moved(source, pose), reference, assembly);
    };
    const Drawn to_right = drawn(right), upwards = drawn(up);
    const double pixels = 1.05 * to_right.scene.scale / to_right.scene.length;
    EXPECT_NEAR(offset(to_right, panel).first, pixels, 1);
    EXPECT_NEAR(offset(to_right, panel).second, 0, 1);
    EXPECT_NEAR(offset(upwards, panel).first, 0, 1);
    EXPECT_NEAR(offset(upwards, panel).second, -1.05 * upwards.scene.scale / upwards.scene.length, 1);
  }
}

TEST(Picture, AssembledCloudsMeet) {
  Random random(5);
  const PointCloud source = test::random_cloud(random, 500);
  const Pose truth = test::random_pose(random);
  Assembly assembly;
  assembly.T_reference_source = truth;
  const PointCloud reference = moved(source, truth);
  const Scene scene(source, reference, assembly, {});
  const Panel& panel = scene.panels[3];
  for (std::size_t i = 0; i < source.size(); ++i)
    EXPECT_LT((scene.project(panel, scene.assembled.points[i] + panel.parts[0].offset) -
               scene.project(panel, scene.reference.points[i]))
                  .norm(),
              0.01);
}

TEST(Picture, KeyPointsAreMarked) {
  Random random(7);
  const PointCloud source = test::random_cloud(random, 500), reference = test::random_cloud(random, 500);
  Assembly assembly;
  assembly.source_key_points = {source.positions[3]};
  assembly.reference_key_points = {reference.positions[5]};
  const Drawn drawn(source, reference, assembly);
  const auto color = [&](const Vector3f& at) {
    const std::size_t pixel =
        static_cast<std::size_t>(at[1]) * drawn.image.width + static_cast<std::size_t>(at[0]);
    return std::array<int, 3>{drawn.image.rgb[3 * pixel], drawn.image.rgb[3 * pixel + 1],
                              drawn.image.rgb[3 * pixel + 2]};
  };
  const auto dark = [&](Role role) {
    const Color c = color_of(role);
    return std::array<int, 3>{static_cast<int>(std::lround(255 * c.r * 0.62F)),
                              static_cast<int>(std::lround(255 * c.g * 0.62F)),
                              static_cast<int>(std::lround(255 * c.b * 0.62F))};
  };
  EXPECT_EQ(color(drawn.scene.project(drawn.scene.panels[0], drawn.scene.source.points[3])),
            dark(Role::source));
  EXPECT_EQ(color(drawn.scene.project(drawn.scene.panels[1], drawn.scene.reference.points[5])),
            dark(Role::reference));
  const Drawn without(source, reference, assembly, {.key_points = false, .view = along_z});
  EXPECT_EQ(without.image.rgb, Drawn(source, reference).image.rgb);
  EXPECT_NE(without.image.rgb, drawn.image.rgb);
}

TEST(Picture, ViewTurnsWithTheReference) {
  Random random(11);
  for (int i = 0; i < 5; ++i) {
    const PointCloud cloud = test::random_cloud(random, 400);
    const Pose motion = test::random_pose(random);
    const Eigen::Matrix3d view = three_quarter_view(cloud.positions),
                          turned = three_quarter_view(moved(cloud, motion).positions);
    EXPECT_TRUE((view * view.transpose()).isIdentity(1e-12));
    EXPECT_GT(view.determinant(), 0);
    const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(motion.rotation.data());
    EXPECT_TRUE((turned * R).isApprox(view, 1e-8));
  }
}

TEST(Picture, LooksTheSameWhateverTheFrameAndTheUnits) {
  Random random(13);
  const PointCloud source = test::random_cloud(random, 300), reference = test::random_cloud(random, 300);
  Assembly assembly;
  assembly.T_reference_source = test::random_pose(random);
  const Scene plain(source, reference, assembly, {});

  const Pose frame = {test::random_pose(random).rotation, {500'000, -4'000'000, 30}};
  Assembly framed = assembly;
  framed.T_reference_source = frame * assembly.T_reference_source * frame.inverse();
  const Scene elsewhere(moved(source, frame), moved(reference, frame), framed, {});
  for (int panel = 0; panel < 4; ++panel)
    for (std::size_t i = 0; i < 300; ++i)
      for (std::size_t part = 0; part < plain.panels[panel].parts.size(); ++part) {
        const auto place = [&](const Scene& scene) -> Vector3f {
          const Panel& where = scene.panels[panel];
          return scene.project(where, where.parts[part].cloud->points[i] + where.parts[part].offset);
        };
        EXPECT_LT((place(plain) - place(elsewhere)).norm(), 0.02) << panel << " " << i;
      }
}

TEST(Picture, SameInputSamePicture) {
  Random random(17);
  const PointCloud source = test::random_cloud(random, 5000), reference = test::random_cloud(random, 100);
  EXPECT_EQ(Drawn(source, reference).image.rgb, Drawn(source, reference).image.rgb);
}

TEST(Picture, DistantCloudsAreDrawnCloserAndItSaysSo) {
  const PointCloud reference = sheet(0), far = moved(sheet(0), {along_z, {4e6, 1e6, 0}});
  const Scene near(sheet(0), reference, {}, {}), apart(far, reference, {}, {});
  EXPECT_EQ(near.panels[2].note, "as given");
  EXPECT_EQ(apart.panels[2].note, "as given, drawn closer");
  EXPECT_THAT(apart.panels[3].note, HasSubstr("drawn closer"));
  EXPECT_GT(apart.scale, near.scale / 2.6);
}

TEST(Picture, MillionsOfPointsMakeASurfaceAndAThousandStayPoints) {
  for (const bool normals : {false, true}) {
    const PointCloud dense = sphere(1'000'000, normals);
    const std::clock_t start = std::clock();
    const Drawn drawn(sphere(1000, normals), dense);
    EXPECT_LT(static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC, 30) << "1.5 s, without sanitizers";

    const auto inside = [&](int panel, Paint paint) {
      const Panel& where = drawn.scene.panels[panel];
      const double radius = 0.97 * drawn.scene.scale / drawn.scene.length;
      int found = 0, all = 0;
      for (int y = 0; y < drawn.image.height; ++y)
        for (int x = where.left; x < where.left + where.width; ++x) {
          if (std::hypot(x + 0.5 - where.middle[0], y + 0.5 - where.middle[1]) > radius) continue;
          ++all;
          found += paint_at(drawn.image, x, y) == paint;
        }
      return static_cast<double>(found) / all;
    };
    EXPECT_EQ(inside(1, Paint::blue), 1);
    EXPECT_GT(inside(0, Paint::orange), 0.5);
    EXPECT_GT(inside(0, Paint::white), 0.01);
  }
}

TEST(Picture, DrawsCloudsWithoutExtent) {
  const PointCloud one = cloud_of({{7, 7, 7}}), same = cloud_of(std::vector<Vec3d>(50, Vec3d{1, 2, 3}));
  for (const auto& [source, reference] : {std::pair(one, same), std::pair(same, one), std::pair(one, one)}) {
    const Drawn drawn(source, reference, {}, {});
    EXPECT_GT(drawn.of(0, Paint::orange).count, 0);
    EXPECT_GT(drawn.of(1, Paint::blue).count, 0);
  }
  const PointCloud line = cloud_of({{0, 0, 0}, {1e-200, 0, 0}, {3e-200, 0, 0}});
  EXPECT_GT(Drawn(line, line, {}, {}).of(0, Paint::orange).count, 0);
}

TEST(Picture, FitsEverySize) {
  Random random(19);
  const PointCloud source = test::random_cloud(random, 200), reference = test::random_cloud(random, 200);
  for (const auto& [width, height] :
       {std::pair(640, 240), {640, 2000}, {1000, 333}, {4000, 240}, {3840, 2160}}) {
    const PictureOptions options = {.width = width, .height = height};
    const Drawn drawn(source, reference, {}, options);
    EXPECT_EQ(drawn.image.width, width);
    EXPECT_EQ(drawn.image.height, height);
    int right = 0;
    for (const Panel& panel : drawn.scene.panels) {
      EXPECT_EQ(panel.left, right);
      right = panel.left + panel.width;
      EXPECT_GE(panel.width, drawn.scene.letter * text_width(panel.note));
      for (const Part& part : panel.parts) {
        for (const Vector3f& point : part.cloud->points) {
          const Vector3f at = drawn.scene.project(panel, point + part.offset);
          EXPECT_GT(at[0], panel.left + 6);
          EXPECT_LT(at[0], right - 6);
          EXPECT_GT(at[1], 6);
          EXPECT_LT(at[1], height - drawn.scene.caption_height - 6);
        }
      }
    }
    EXPECT_LE(right, width);
    EXPECT_GE(right, width - 4);
  }
}

TEST(Picture, CaptionsAreReadable) {
  EXPECT_EQ(with_commas(0), "0");
  EXPECT_EQ(with_commas(999), "999");
  EXPECT_EQ(with_commas(1000), "1,000");
  EXPECT_EQ(with_commas(1234567), "1,234,567");
  EXPECT_EQ(text_width(""), 0);
  EXPECT_EQ(text_width("ab"), 11);

  const auto text = [](std::string_view letters) {
    Image image = {.width = 60, .height = 20, .rgb = std::vector<std::uint8_t>(60 * 20 * 3, 255)};
    draw_text(image, letters, 2, 2, 1, {0, 0, 0});
    return image.rgb;
  };
  // No two letters look the same, and all that captions use are there.
  const std::string letters = "abcdefghijklmnopqrstuvwxyz0123456789,.%-";
  for (std::size_t i = 0; i < letters.size(); ++i) {
    EXPECT_NE(text(letters.substr(i, 1)), text(" ")) << letters[i];
    for (std::size_t j = 0; j < i; ++j) EXPECT_NE(text(letters.substr(i, 1)), text(letters.substr(j, 1)));
  }
  EXPECT_EQ(text("\xc3?"), text("  "));
  EXPECT_NO_FATAL_FAILURE(text("longer than the image is wide, by far"));
}

TEST(Picture, RefusesWhatCannotBeDrawn) {
  const PointCloud good = sheet(0, 3);
  const auto refused = [&](const PointCloud& source, const PointCloud& reference, const Assembly& assembly,
                           const PictureOptions& options, const std::string& says) {
    const auto image = render_picture(source, reference, assembly, options);
    ASSERT_FALSE(image) << says;
    EXPECT_EQ(image.error().code, ErrorCode::invalid_argument);
    EXPECT_THAT(image.error().message, HasSubstr(says));
  };
  refused({}, good, {}, {}, "source: no points");
  refused(good, {}, {}, {}, "reference: no points");
  PointCloud bad = good;
  bad.normals = {{0, 0, 1}};
  refused(good, bad, {}, {}, "reference: 1 normals for 9 points");
  refused(cloud_of({{0, 0, 0}, {0, NAN, 0}}), good, {}, {}, "source: point 1");
  refused(good, cloud_of({{1e200, 0, 0}}), {}, {}, "reference: point 0");
  Assembly failed;
  failed.T_reference_source.rotation[4] = NAN;
  refused(good, good, failed, {}, "pose");
  Assembly keys;
  keys.source_key_points = {{0, INFINITY, 0}};
  refused(good, good, keys, {}, "key point");
  refused(good, good, {}, {.width = 639}, "639");
  refused(good, good, {}, {.height = 20000}, "20000");
  refused(good, good, {}, {.view = std::array<double, 9>{}}, "view");
  refused(good, good, {}, {.view = std::array<double, 9>{1, 0, 0, 0, 1, 0, 0, 0, -1}}, "view");
}

}  // namespace
}  // namespace bitr::picture
