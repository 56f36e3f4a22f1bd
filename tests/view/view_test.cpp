#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bitr/view.hpp>
#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "core/base64.hpp"
#include "core/random.hpp"
#include "page/normals.hpp"
#include "page/thin.hpp"

namespace bitr::view {
namespace {

using testing::HasSubstr;
using testing::Not;

std::string decoded(const std::string& text) {
  const std::string letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string bits, bytes;
  for (const char c : text)
    for (int bit = 5; c != '=' && bit >= 0; --bit) bits += letters.find(c) >> bit & 1 ? '1' : '0';
  for (std::size_t i = 0; i + 8 <= bits.size(); i += 8)
    bytes += static_cast<char>(std::stoi(bits.substr(i, 8), nullptr, 2));
  return bytes;
}

std::vector<float> floats(const nlohmann::json& text) {
  const std::string bytes = decoded(text);
  std::vector<float> values(bytes.size() / 4);
  std::memcpy(values.data(), bytes.data(), 4 * values.size());
  return values;
}

TEST(Base64, IsTheStandards) {
  // RFC 4648, section 10.
  const std::pair<const char*, const char*> known[] = {{"", ""},
                                                       {"f", "Zg=="},
                                                       {"fo", "Zm8="},
                                                       {"foo", "Zm9v"},
                                                       {"foob", "Zm9vYg=="},
                                                       {"fooba", "Zm9vYmE="},
                                                       {"foobar", "Zm9vYmFy"}};
  for (const auto& [bytes, text] : known)
    EXPECT_EQ(base64(std::as_bytes(std::span(bytes, std::strlen(bytes)))), text);
  Random random(1);
  for (int length = 0; length < 70; ++length) {
    std::string bytes;
    for (int i = 0; i < length; ++i) bytes += static_cast<char>(random.below(256));
    EXPECT_EQ(decoded(base64(std::as_bytes(std::span(bytes)))), bytes);
  }
}

std::vector<Vec3d> cube(std::size_t count, std::uint64_t seed) {
  Random random(seed);
  std::vector<Vec3d> points(count);
  for (Vec3d& point : points) point = {random.uniform(), random.uniform(), random.uniform()};
  return points;
}

TEST(Thinned, KeepsEveryRegionsShare) {
  // Two thirds of the points in one half.
  std::vector<Vec3d> points = cube(20'000, 1);
  for (const Vec3d& point : cube(10'000, 2)) points.push_back({point[0] / 2, point[1], point[2]});
  const std::vector<std::size_t> kept = thinned(points, 3'000);
  ASSERT_EQ(std::set<std::size_t>(kept.begin(), kept.end()).size(), 3'000u);
  int all[64] = {}, some[64] = {};
  const auto octant = [&](std::size_t i) {
    const Vec3d& p = points[i];
    return static_cast<int>(4 * p[0]) * 16 + static_cast<int>(4 * p[1]) * 4 + static_cast<int>(4 * p[2]);
  };
  for (std::size_t i = 0; i < points.size(); ++i) ++all[octant(i)];
  for (const std::size_t i : kept) ++some[octant(i)];
  // The box of the points is all but the unit cube: cells a hair from its octants. At random: ± 7.
  for (int i = 0; i < 64; ++i) EXPECT_NEAR(some[i], all[i] / 10.0, 3.5) << i;
}

TEST(Thinned, TakesOddCloudsAsTheyAre) {
  EXPECT_EQ(thinned(cube(5, 1), 5), (std::vector<std::size_t>{0, 1, 2, 3, 4}));
  EXPECT_EQ(thinned(cube(5, 1), 9).size(), 5u);
  const std::vector<std::size_t> same = thinned(std::vector<Vec3d>(10, {1e90, -1e90, 3}), 4);
  EXPECT_EQ(std::set<std::size_t>(same.begin(), same.end()).size(), 4u);
  std::vector<Vec3d> far = cube(100, 3);
  for (Vec3d& point : far)
    for (double& x : point) x *= 1e100;
  EXPECT_EQ(thinned(far, 50), thinned(cube(100, 3), 50)) << "units do not matter";
}

TEST(FittedNormals, AreThoseOfASphere) {
  Random random(2);
  std::vector<Vec3d> points(4'000);
  for (Vec3d& point : points) {
    point = {random.normal(), random.normal(), random.normal()};
    const double length = std::hypot(point[0], point[1], point[2]);
    for (double& x : point) x /= length;
  }
  const PointRows rows{points};
  const PointTree tree(3, rows);
  const std::vector<Vec3f> normals = fitted_normals(tree, points);
  double worst = 1;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3f& n = normals[i];
    EXPECT_NEAR(std::hypot(n[0], n[1], n[2]), 1, 1e-5);
    worst = std::min(worst, std::abs(points[i][0] * n[0] + points[i][1] * n[1] + points[i][2] * n[2]));
  }
  EXPECT_GT(worst, std::cos(0.3));
}

TEST(FittedNormals, StandPointsInOnePlace) {
  const std::vector<Vec3d> points(20, {1, 2, 3});
  const PointRows rows{points};
  const PointTree tree(3, rows);
  for (const Vec3f& n : fitted_normals(tree, points)) EXPECT_NEAR(std::hypot(n[0], n[1], n[2]), 1, 1e-5);
}

class View : public testing::Test {
 protected:
  void SetUp() override {
    if (!has_view()) GTEST_SKIP() << "built without viewer/node_modules";
    Random random(4);
    source.positions = cube(300, 5);
    reference.positions = cube(200, 6);
    for (Vec3d& point : reference.positions) point = {point[0] + 1e6, point[1] - 2e6, point[2]};
    assembly.T_reference_source.rotation = random.rotation();
    assembly.T_reference_source.translation = {1e6, -2e6, 0.25};
    assembly.source_key_points = {{0.5, 0.25, 0.75}};
    assembly.reference_key_points = {{1e6, -2e6, 0}};
  }

  nlohmann::json data(const ViewOptions& options = {}) const {
    const auto html = render_view(source, reference, assembly, options);
    EXPECT_TRUE(html) << html.error().message;
    const std::string begin = "<script id=\"data\" type=\"application/json\">";
    const std::size_t from = html->find(begin) + begin.size();
    return nlohmann::json::parse(html->substr(from, html->find("</script>", from) - from));
  }

  void refuse(const std::string& why, const ViewOptions& options = {}) const {
    const auto html = render_view(source, reference, assembly, options);
    ASSERT_FALSE(html) << why;
    EXPECT_EQ(html.error().code, ErrorCode::invalid_argument);
    EXPECT_THAT(html.error().message, HasSubstr(why));
  }

  PointCloud source, reference;
  Assembly assembly;
};

TEST_F(View, HasEveryPointToSevenDigitsOfItsSize) {
  const auto json = data();
  const double length = json["length"];
  for (const auto& [name, cloud, keys] :
       {std::tuple("source", source, assembly.source_key_points),
        std::tuple("reference", reference, assembly.reference_key_points)}) {
    EXPECT_EQ(json[name]["count"], cloud.size());
    EXPECT_EQ(json[name]["shown"], cloud.size());
    const std::vector<float> positions = floats(json[name]["positions"]);
    ASSERT_EQ(positions.size(), 3 * cloud.size());
    for (std::size_t i = 0; i < positions.size(); ++i) {
      const double centre = json[name]["centre"][i % 3];
      EXPECT_NEAR(centre + positions[i] * length, cloud.positions[i / 3][i % 3], 1e-7 + 3e-10) << name;
    }
    const std::vector<float> key_points = floats(json[name]["key_points"]);
    ASSERT_EQ(key_points.size(), 3 * keys.size());
    for (int i = 0; i < 3; ++i)
      EXPECT_NEAR(double(json[name]["centre"][i]) + key_points[i] * length, keys[0][i], 1e-7 + 3e-10);
    EXPECT_EQ(decoded(json[name]["normals"]).size(), 3 * cloud.size());
    EXPECT_FALSE(json[name].contains("colors"));
  }
}

TEST_F(View, TakesTheSourcesCentreToItsPlace) {
  const auto json = data();
  const auto vec = [](const nlohmann::json& v) { return Vec3d{v[0], v[1], v[2]}; };
  const Vec3d place = assembly.T_reference_source.apply(vec(json["source"]["centre"]));
  for (int i = 0; i < 3; ++i)
    EXPECT_NEAR(double(json["poses"][0]["after"][i]) * double(json["length"]) + double(json["reference"]["centre"][i]),
                place[i], 1e-9);
  // A million away is drawn closer, in the same direction.
  EXPECT_TRUE(json["brought_closer"]);
  EXPECT_NEAR(double(json["before"][1]) / double(json["before"][0]), -2, 1e-5);
  EXPECT_LT(std::hypot(double(json["before"][0]), double(json["before"][1])), 1.2);
  reference.positions = cube(200, 6);
  EXPECT_FALSE(data()["brought_closer"]);
}

TEST_F(View, ThinsWhatIsLarge) {
  const auto json = data({.most_points = 100});
  EXPECT_EQ(json["source"]["count"], 300);
  EXPECT_EQ(json["source"]["shown"], 100);
  EXPECT_EQ(floats(json["source"]["positions"]).size(), 300u);
  EXPECT_EQ(json["reference"]["shown"], 100);
}

TEST_F(View, KeepsColoursAndNormals) {
  for (std::size_t i = 0; i < source.size(); ++i) {
    const auto x = static_cast<float>(i) / 299;
    source.colors.push_back({x, 1 - x, 2});
    source.normals.push_back({-1, 0, x});
  }
  const auto json = data();
  const std::string colors = decoded(json["source"]["colors"]), normals = decoded(json["source"]["normals"]);
  for (std::size_t i = 0; i < source.size(); ++i) {
    const float x = source.colors[i][0];
    EXPECT_EQ(static_cast<std::uint8_t>(colors[3 * i]), std::lround(255 * x));
    EXPECT_EQ(static_cast<std::uint8_t>(colors[3 * i + 2]), 255) << "clamped";
    EXPECT_EQ(static_cast<std::int8_t>(normals[3 * i]), -127);
    EXPECT_EQ(static_cast<std::int8_t>(normals[3 * i + 2]), std::lround(127 * x));
  }
  EXPECT_FALSE(json["reference"].contains("colors"));
}

TEST_F(View, NamesAndReportsCannotLeaveTheirPlace) {
  const std::string nasty = "</script><script>alert(1)</script><!--<script>\"'\\\n\x80";
  nlohmann::json report = {{nasty.substr(0, nasty.size() - 1), {1, nullptr, nasty.substr(0, 30)}}};
  const ViewOptions options = {.source_name = nasty, .reference_name = "&amp;", .report = report.dump()};
  const auto json = data(options);
  EXPECT_EQ(json["report"], report);
  EXPECT_EQ(json["reference"]["name"], "&amp;");
  EXPECT_THAT(std::string(json["source"]["name"]), HasSubstr("</script><script>alert(1)"));
  const std::string html = render_view(source, reference, assembly, options).value();
  EXPECT_THAT(html, Not(HasSubstr("<script>alert")));
  EXPECT_THAT(html, Not(HasSubstr("<!--<script")));
}

TEST_F(View, AsksForNothingElse) {
  const std::string html = render_view(source, reference, assembly, {}).value();
  EXPECT_THAT(html, HasSubstr("default-src 'none'"));
  for (const char* loads : {"<script src", "<link rel=\"stylesheet", "@import", "import(", "<iframe"})
    EXPECT_THAT(html, Not(HasSubstr(loads)));
  EXPECT_EQ(html, render_view(source, reference, assembly, {}).value()) << "same input, same page";
}

TEST_F(View, RefusesWhatItCannotShow) {
  refuse("most", {.most_points = 0});
  for (const char* report : {"", "[]", "3", "{", "null"}) refuse("report", {.report = report});
  const PointCloud whole = source;
  source.colors.resize(2);
  refuse("source: 2 colours for 300 points");
  source = whole;
  reference.normals.resize(3);
  refuse("reference: 3 normals");
  reference.normals.clear();
  source.positions[7][1] = std::numeric_limits<double>::quiet_NaN();
  refuse("source: point 7");
  source.positions.clear();
  refuse("source: no points");
  source = whole;
  assembly.T_reference_source.translation[0] = std::numeric_limits<double>::infinity();
  refuse("pose");
}

TEST_F(View, StandsTinyAndLevelClouds) {
  source.positions = {{1, 2, 3}};
  reference.positions.assign(30, {4, 5, 6});
  assembly.T_reference_source = {};
  const auto json = data();
  for (const float x : floats(json["reference"]["positions"])) EXPECT_EQ(x, 0);
  EXPECT_GT(json["source"]["spacing"], 0);
}

}  // namespace
}  // namespace bitr::view
