#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "io/cloud_bytes.hpp"
#include "io/formats.hpp"

namespace bitr::io {
namespace {

Result<Geometry> ply(const std::string& content, const ReadOptions& options = {}) {
  return parse(content, CloudFormat::ply, options);
}

std::string xyz_header(const std::string& format, int count) {
  return "ply\nformat " + format + " 1.0\nelement vertex " + std::to_string(count) +
         "\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
}

TEST(Ply, ReadsTextAndBothByteOrders) {
  const auto text = ply(xyz_header("ascii", 2) + "1 2 3\n-4.5 .25 1e3\n");
  const auto le = ply(xyz_header("binary_little_endian", 2) + little(1.f, 2.f, 3.f, -4.5f, .25f, 1e3f));
  const auto be = ply(xyz_header("binary_big_endian", 2) + big(1.f, 2.f, 3.f, -4.5f, .25f, 1e3f));
  for (const auto* read : {&text, &le, &be}) {
    ASSERT_TRUE(*read) << message(*read);
    EXPECT_EQ((*read)->cloud.positions, two_points);
    EXPECT_TRUE((*read)->cloud.normals.empty());
    EXPECT_TRUE((*read)->cloud.colors.empty());
    EXPECT_FALSE((*read)->is_mesh());
  }
}

TEST(Ply, ReadsEveryScalarType) {
  const auto read = [](const std::string& type, const std::string& bytes) {
    const auto got = ply("ply\nformat binary_big_endian 1.0\nelement vertex 1\nproperty " + type +
                         " x\nproperty float y\nproperty double z\nend_header\n" + bytes);
    return got ? got->cloud.positions[0] : Vec3d{};
  };
  const std::string rest = big(0.5f, 0.1);
  const auto expect = [](double x) { return Vec3d{x, 0.5, 0.1}; };
  EXPECT_EQ(read("char", big(std::int8_t{-7}) + rest), expect(-7));
  EXPECT_EQ(read("uint8", big(std::uint8_t{200}) + rest), expect(200));
  EXPECT_EQ(read("int16", big(std::int16_t{-700}) + rest), expect(-700));
  EXPECT_EQ(read("ushort", big(std::uint16_t{60000}) + rest), expect(60000));
  EXPECT_EQ(read("int", big(std::int32_t{-70000}) + rest), expect(-70000));
  EXPECT_EQ(read("uint32", big(std::uint32_t{4000000000}) + rest), expect(4e9));
  EXPECT_EQ(read("float32", big(1.5f) + rest), expect(1.5));
  EXPECT_EQ(read("float64", big(0.1) + rest), expect(0.1));
}

TEST(Ply, TakesPropertiesInAnyOrderAndSkipsTheRest) {
  const std::string header =
      "comment made by hand\nobj_info two points\nelement material 2\nproperty int id\nproperty list uchar "
      "float "
      "weights\nelement vertex 2\nproperty uchar blue\nproperty double z\nproperty list ushort short "
      "neighbours\nproperty float nx\nproperty float ny\nproperty float nz\nproperty float quality\nproperty "
      "double y\nproperty uchar red\nproperty uchar green\nproperty double x\nelement edge 1\nproperty int "
      "a\nend_header\n";
  const auto text =
      ply("ply\r\nformat ascii 1.0\r\n" + header +
          "5 2 .5 .25\n6 0\n\n255 3 2 8 9 0 0 2 nan 2 51 0 1\n0 1000 0 0 1 0 inf .25 0 102 -4.5\n9\n");
  const auto binary = ply("ply\nformat binary_little_endian 1.0\n" + header +
                          little(5, std::uint8_t{2}, .5f, .25f, 6, std::uint8_t{0})  //
                          + little(std::uint8_t{255}, 3., std::uint16_t{2}, std::int16_t{8}, std::int16_t{9},
                                   0.f, 0.f, 2.f, NAN, 2., std::uint8_t{51}, std::uint8_t{0}, 1.)  //
                          + little(std::uint8_t{0}, 1e3, std::uint16_t{0}, 0.f, 1.f, 0.f, INFINITY, .25,
                                   std::uint8_t{0}, std::uint8_t{102}, -4.5) +
                          little(9));
  for (const auto* read : {&text, &binary}) {
    ASSERT_TRUE(*read) << message(*read);
    EXPECT_EQ((*read)->cloud.positions, two_points);
    EXPECT_EQ((*read)->cloud.normals, (std::vector<Vec3f>{{0, 0, 1}, {0, 1, 0}}));
    const std::vector<Vec3f> colors = {{51 / 255.f, 0, 1}, {0, 102 / 255.f, 0}};
    for (int i = 0; i < 6; ++i) EXPECT_FLOAT_EQ((*read)->cloud.colors[i / 3][i % 3], colors[i / 3][i % 3]);
  }
}

TEST(Ply, SplitsPolygonsIntoFans) {
  const std::string header =
      " 1.0\nelement face 3\nproperty list uchar uint vertex_index\nproperty uchar flag\nelement vertex "
      "5\nproperty char x\nproperty char y\nproperty char z\nend_header\n";
  const std::string faces = little(std::uint8_t{3}, 0u, 1u, 2u, std::uint8_t{9}) +
                            little(std::uint8_t{5}, 0u, 1u, 2u, 3u, 4u, std::uint8_t{9}) +
                            little(std::uint8_t{2}, 0u, 1u, std::uint8_t{9});
  const auto binary = ply("ply\nformat binary_little_endian" + header + faces + std::string(15, '\1'));
  const auto text = ply("ply\nformat ascii" + header +
                        "3 0 1 2 9\n5 0 1 2 3 4 9\n2 0 1 9\n1 1 1\n1 1 1\n1 1 1\n1 1 1\n1 1 1");
  for (const auto* read : {&text, &binary}) {
    ASSERT_TRUE(*read) << message(*read);
    EXPECT_TRUE((*read)->is_mesh());
    EXPECT_EQ((*read)->mesh.vertices, std::vector<Vec3d>(5, {1, 1, 1}));
    const std::vector<std::array<std::uint32_t, 3>> fan = {{0, 1, 2}, {0, 1, 2}, {0, 2, 3}, {0, 3, 4}};
    EXPECT_EQ((*read)->mesh.triangles, fan);
  }
}

TEST(Ply, ReadsColoursOfEveryScale) {
  const auto color = [](const std::string& type, const std::string& row) {
    const auto got =
        ply("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float "
            "z\nproperty " +
            type + " red\nproperty " + type + " green\nproperty " + type + " blue\nend_header\n0 0 0 " + row);
    return got ? got->cloud.colors.at(0) : Vec3f{-1, -1, -1};
  };
  EXPECT_EQ(color("uchar", "255 0 255"), (Vec3f{1, 0, 1}));
  EXPECT_EQ(color("ushort", "65535 0 65535"), (Vec3f{1, 0, 1}));
  EXPECT_EQ(color("float", "1 0 0.5"), (Vec3f{1, 0, 0.5}));
  EXPECT_EQ(color("float", "255 0 255"), (Vec3f{1, 0, 1}));
  EXPECT_EQ(color("float", "nan 0 0"), (Vec3f{-1, -1, -1}));
}

TEST(Ply, NormalsAreUnitOrAbsent) {
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float "
      "z\nproperty double "
      "nx\nproperty double ny\nproperty double nz\nend_header\n";
  const auto scaled = ply(header + "0 0 0 1e-300 0 0\n0 0 0 0 -3e200 4e200\n");
  ASSERT_TRUE(scaled) << message(scaled);
  EXPECT_EQ(scaled->cloud.normals, (std::vector<Vec3f>{{1, 0, 0}, {0, -0.6f, 0.8f}}));
  const auto none = ply(header + "0 0 0 0 0 0\n0 0 0 0 0 0\n");
  ASSERT_TRUE(none) << message(none);
  EXPECT_TRUE(none->cloud.normals.empty());
  EXPECT_EQ(message(ply(header + "0 0 0 0 0 1\n0 0 0 0 0 0\n")),
            "scan.dat: line 12: point 1: the normal is zero; a file gives every point a normal or none");
  EXPECT_EQ(message(ply(header + "0 0 0 nan 0 1\n0 0 0 0 0 1\n")),
            "scan.dat: line 11: point 0: the normal is (nan, 0, 1); it must be finite");
}

TEST(Ply, HeaderMayEndLinesAsOldMacsDid) {
  std::string header = xyz_header("binary_little_endian", 1);
  std::replace(header.begin(), header.end(), '\n', '\r');
  const auto read = ply(header + little(1.f, 2.f, 3.f));
  ASSERT_TRUE(read) << message(read);
  EXPECT_EQ(read->cloud.positions[0], (Vec3d{1, 2, 3}));
}

TEST(Ply, MessagesNameTheValueAndTheLimit) {
  const std::string le = xyz_header("binary_little_endian", 2), text = xyz_header("ascii", 2);
  EXPECT_EQ(message(ply(le + std::string(23, 'x'))),
            "scan.dat: byte 115: 2 rows of \"vertex\" need 24 bytes, 23 remain");
  EXPECT_EQ(message(ply(text + "1 2 3\n1 nan 3\n", strict)),
            "scan.dat: line 9: point 1: y is nan; coordinates must be finite");
  EXPECT_EQ(message(ply(text + "1 2 3\n1 2 1e999\n")),
            "scan.dat: line 9: \"z\" is \"1e999\", not a finite number");
  EXPECT_EQ(message(ply(text + "1 2 3 4\n1 2 3\n")),
            "scan.dat: line 8: \"4\" after the last property of \"vertex\"");
  EXPECT_EQ(message(ply(text + "1 2\n3 4 5 6\n")), "scan.dat: line 8: no value for \"z\"");
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(message(ply(le + little(0.f, 0.f, 0.f, 0.f, 0.f, nan), strict)),
            "scan.dat: byte 127: point 1: z is nan; coordinates must be finite");
}

PointCloud awkward_cloud() {
  PointCloud cloud;
  cloud.positions = {{0.1, -1e-300, 4523456.789012}, {1.0 / 3, 1e300, -0.0}};
  cloud.normals = {{0, 0.6f, 0.8f}, {0.57735026f, 0.57735026f, 0.57735026f}};
  cloud.colors = {{0, 1, 128 / 255.f}, {1, 1, 1}};
  return cloud;
}

TEST(Ply, WhatIsWrittenIsWhatIsRead) {
  PointCloud floats;
  floats.positions = {{0.1f, -1e-30f, 4523456.5f}, {16777216.f, 3e38f, 0.f}};
  for (const PointCloud& cloud : {awkward_cloud(), floats}) {
    for (const auto encoding : {PlyEncoding::ascii, PlyEncoding::binary_little_endian}) {
      const auto bytes = serialize_ply(cloud, encoding);
      ASSERT_TRUE(bytes);
      const auto read = parse_geometry(*bytes, CloudFormat::ply, "scan.ply");
      ASSERT_TRUE(read) << message(read);
      EXPECT_EQ(read->cloud.positions, cloud.positions);
      EXPECT_EQ(read->cloud.normals, cloud.normals);
      EXPECT_EQ(read->cloud.colors, cloud.colors);
    }
  }
}

TEST(Ply, WritesTheSmallestExactType) {
  PointCloud cloud;
  cloud.positions = {{0.5, 0.25, 3}};
  const auto written = [&] {
    const auto bytes = serialize_ply(cloud, PlyEncoding::binary_little_endian);
    return std::string(reinterpret_cast<const char*>(bytes->data()), bytes->size());
  };
  EXPECT_NE(written().find("property float x"), std::string::npos);
  cloud.positions[0][2] = 0.1;
  EXPECT_NE(written().find("property double x"), std::string::npos);
}

TEST(Ply, RefusesToWriteWhatItWouldRefuseToRead) {
  PointCloud cloud = awkward_cloud();
  cloud.positions[1][0] = NAN;
  EXPECT_EQ(message(serialize_ply(cloud, PlyEncoding::ascii)), "point 1 is not finite");
  cloud = awkward_cloud();
  cloud.normals.pop_back();
  EXPECT_EQ(message(serialize_ply(cloud, PlyEncoding::ascii)), "1 normals for 2 points");
}

}  // namespace
}  // namespace bitr::io
