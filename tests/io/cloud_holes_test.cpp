// Points that were not seen, and points without a normal: what becomes of them in every format.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "io/cloud_bytes.hpp"

namespace bitr::io {
namespace {

struct HoledFile {
  const char* name;
  CloudFormat format;
  std::string content;  ///< (1, 2, 3), a hole, (4, 5, 6), another hole
};

std::vector<HoledFile> holed_files() {
  const std::string pcd = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 4\nHEIGHT 1\nDATA ";
  const std::string ply =
      "element vertex 4\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
  const std::string text = "1 2 3\nnan nan nan\n4 5 6\n0 inf 0\n";
  const std::string binary = little(1.f, 2.f, 3.f, NAN, NAN, NAN) + little(4.f, 5.f, 6.f, 0.f, INFINITY, 0.f);
  std::string header = "{'descr': '<f4', 'fortran_order': False, 'shape': (4, 3), }";
  header.append(118 - header.size() - 1, ' ').append("\n");
  const std::string npy = std::string("\x93NUMPY\x01\x00", 8) + little(std::uint16_t{118}) + header;
  return {{"text", CloudFormat::text, text},
          {"pcd ascii", CloudFormat::pcd, pcd + "ascii\n" + text},
          {"pcd binary", CloudFormat::pcd, pcd + "binary\n" + binary},
          {"ply ascii", CloudFormat::ply, "ply\nformat ascii 1.0\n" + ply + text},
          {"ply binary", CloudFormat::ply, "ply\nformat binary_little_endian 1.0\n" + ply + binary},
          {"npy", CloudFormat::npy, npy + binary},
          {"obj", CloudFormat::obj, "v 1 2 3\nv nan nan nan\nv 4 5 6\nv 0 inf 0\n"}};
}

TEST(Holes, AreLeftOutAndCounted) {
  for (const HoledFile& file : holed_files()) {
    SCOPED_TRACE(file.name);
    const auto read = parse(file.content, file.format);
    ASSERT_TRUE(read) << message(read);
    EXPECT_EQ(read->cloud.positions, (std::vector<Vec3d>{{1, 2, 3}, {4, 5, 6}}));
    EXPECT_EQ(read->holes, 2u);
    EXPECT_EQ(read->bare, 0u);
  }
}

TEST(Holes, AreRefusedByNameWhereAsked) {
  for (const HoledFile& file : holed_files()) {
    SCOPED_TRACE(file.name);
    EXPECT_THAT(message(parse(file.content, file.format, strict)),
                testing::EndsWith("point 1: x is nan; coordinates must be finite"));
  }
}

TEST(Holes, AreNotAllThereIs) {
  EXPECT_EQ(message(parse("nan nan nan\nnan 0 0\n", CloudFormat::text)),
            "scan.dat: none of 2 points is finite");
}

TEST(Holes, AreNoVerticesOfAMesh) {
  EXPECT_EQ(message(parse("v 0 0 0\nv nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 3 4\n", CloudFormat::obj)),
            "scan.dat: line 2: point 1: x is nan; coordinates must be finite");
}

TEST(BarePoints, AreAMattersOfScans) {
  std::string folder = (std::filesystem::temp_directory_path() / "bitr-XXXXXX").string();
  ASSERT_TRUE(mkdtemp(folder.data()));
  const std::string path = folder + "/bare.xyz";
  std::ofstream(path) << "x y z nx ny nz\n1 2 3 0 0 1\n4 5 6 0 0 0\n7 8 9 nan nan nan\nnan 0 0 0 0 1\n";
  const auto scan = read_scan(path);
  ASSERT_TRUE(scan) << scan.error().message;
  EXPECT_EQ(scan->cloud.normals, (std::vector<Vec3f>{{0, 0, 1}, {0, 0, 0}, {0, 0, 0}}));
  EXPECT_EQ(scan->bare, 2u);
  EXPECT_EQ(scan->holes, 1u);
  EXPECT_FALSE(scan->viewpoint);
  EXPECT_FALSE(read_cloud(path));
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace bitr::io
