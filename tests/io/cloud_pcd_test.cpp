#include <gtest/gtest.h>
#include <lzf.h>
#include <sys/resource.h>

#include <bit>
#include <cmath>

#include "io/cloud_bytes.hpp"

namespace bitr::io {
namespace {

Result<Geometry> pcd(const std::string& content, const ReadOptions& options = {}) {
  return parse(content, CloudFormat::pcd, options);
}

const std::string xyz =
    "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT "
    "1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\n";

std::string compressed(const std::string& columns) {
  std::string packed(columns.size() + 64, '\0');
  const unsigned size = lzf_compress(columns.data(), static_cast<unsigned>(columns.size()), packed.data(),
                                     static_cast<unsigned>(packed.size()));
  packed.resize(size);
  return little(size, static_cast<std::uint32_t>(columns.size())) + packed;
}

// The simplest LZF: runs of up to 32 plain bytes, each behind its length.
std::string stored(const std::string& columns) {
  std::string block;
  for (std::size_t at = 0; at < columns.size(); at += 32) {
    const std::string run = columns.substr(at, 32);
    block += static_cast<char>(run.size() - 1) + run;
  }
  return little(static_cast<std::uint32_t>(block.size()), static_cast<std::uint32_t>(columns.size())) + block;
}

TEST(Pcd, ReadsAllThreeDataTypes) {
  const auto text = pcd(xyz + "DATA ascii\n1 2 3\n-4.5 .25 1e3\n");
  const auto binary = pcd(xyz + "DATA binary\n" + little(1.f, 2.f, 3.f, -4.5f, .25f, 1e3f));
  for (const auto* read : {&text, &binary}) {
    ASSERT_TRUE(*read) << message(*read);
    EXPECT_EQ((*read)->cloud.positions, two_points);
  }
  const std::string many =
      "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 10\nHEIGHT 20\nDATA binary_compressed\n";
  std::string data;
  for (int k = 0; k < 3; ++k) {
    for (int i = 0; i < 200; ++i) data += little(static_cast<float>(k * 1000 + i / 10));
  }
  const auto packed = pcd(many + compressed(data));
  ASSERT_TRUE(packed) << message(packed);
  ASSERT_EQ(packed->cloud.size(), 200u);
  EXPECT_EQ(packed->cloud.positions[199], (Vec3d{19, 1019, 2019}));
}

TEST(Pcd, TakesFieldsOfAnyTypeCountAndOrder) {
  const std::string header =
      "VERSION .7\nFIELDS label normal_z _ z rgb y normal_y x normal_x\nSIZE 2 4 1 8 4 2 4 4 4\nTYPE U F U F "
      "U I F I "
      "F\nCOUNT 1 1 3 1 1 1 1 1 1\nWIDTH 1\nHEIGHT 1\nPOINTS 1\n";
  const std::string pad = "abc";
  const std::string row = little(std::uint16_t{7}, 2.f) + pad +
                          little(0.125, 0x00ff3300u, std::int16_t{-2}, 0.f, std::int32_t{1}, 0.f);
  const auto binary = pcd(header + "DATA binary\n" + row);
  const auto columns = pcd(header + "DATA binary_compressed\n" + stored(row));
  const auto text = pcd(header + "DATA ascii\n7 2 9 9 9 0.125 16724736 -2 0 1 0\n");
  for (const auto* read : {&text, &binary, &columns}) {
    ASSERT_TRUE(*read) << message(*read);
    EXPECT_EQ((*read)->cloud.positions[0], (Vec3d{1, -2, 0.125}));
    EXPECT_EQ((*read)->cloud.normals.at(0), (Vec3f{0, 0, 1}));
    EXPECT_EQ((*read)->cloud.colors.at(0), (Vec3f{1, 0.2f, 0}));
  }
}

TEST(Pcd, UnpacksColoursStoredAsFloats) {
  const std::string header = "FIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F F\nWIDTH 1\nHEIGHT 1\n";
  const auto packed = std::bit_cast<float>(0x00ff3300u);
  const auto binary = pcd(header + "DATA binary\n" + little(1.f, 2.f, 3.f, packed));
  const auto text = pcd(header + "DATA ascii\n1 2 3 2.3436490e-38\n");
  ASSERT_TRUE(binary) << message(binary);
  EXPECT_EQ(binary->cloud.colors.at(0), (Vec3f{1, 0.2f, 0}));
  ASSERT_TRUE(text) << message(text);
  EXPECT_EQ(text->cloud.colors.at(0)[0], 1);
}

TEST(Pcd, StrictRefusesTheHolesOfOrganisedScansByRow) {
  EXPECT_EQ(message(pcd(xyz + "DATA ascii\n1 2 3\nnan nan nan\n", strict)),
            "scan.dat: line 13: point 1: x is nan; coordinates must be finite");
  const std::string data = "DATA binary\n";
  EXPECT_EQ(message(pcd(xyz + data + little(1.f, 2.f, 3.f, NAN, NAN, NAN), strict)),
            "scan.dat: byte " + std::to_string(xyz.size() + data.size() + 12) +
                ": point 1: x is nan; coordinates must be finite");
}

TEST(Pcd, TellsWhereTheSensorStoodIfItIsSaid) {
  const auto with = [](const std::string& line) {
    return pcd(line + "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 1\nHEIGHT 1\nDATA ascii\n1 2 3\n");
  };
  EXPECT_EQ(with("VIEWPOINT 1 -2.5 3 1 0 0 0\n")->viewpoint, (Vec3d{1, -2.5, 3}));
  EXPECT_EQ(with("VIEWPOINT 0 0 0 0 1 0 0\n")->viewpoint, (Vec3d{0, 0, 0}));
  // What writers put there that know nothing, nothing at all, and what is none.
  for (const char* line : {"VIEWPOINT 0 0 0 1 0 0 0\n", "", "VIEWPOINT 1 2\n", "VIEWPOINT 1 2 nan 1 0 0 0\n"})
    EXPECT_FALSE(with(line)->viewpoint) << line;
}

TEST(Pcd, BoundsDecompression) {
  const std::string header =
      "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 100000000\nHEIGHT 1\nDATA binary_compressed\n";
  EXPECT_EQ(message(pcd(header + little(20u, 1200000000u) + std::string(20, 'x'))),
            "scan.dat: byte " + std::to_string(header.size()) +
                ": 20 compressed bytes cannot hold 1200000000; LZF's limit is 88 to 1");
  const std::string two = xyz + "DATA binary_compressed\n";
  EXPECT_NE(message(pcd(two + little(4u, 24u) + "\xff\xff\xff\xff")).find("LZF block is damaged"),
            std::string::npos);
  EXPECT_NE(message(pcd(two + little(400u, 24u) + "abcd")).find("400 bytes, 4 remain"), std::string::npos);
  EXPECT_NE(message(pcd(two + little(4u, 36u) + "abcd")).find("2 points need 24 bytes, the block holds 36"),
            std::string::npos);
}

std::uint64_t peak_bytes() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;
}

TEST(Pcd, TakesMemoryForTheFieldsThatMeanSomething) {
  // A last field that unpacks to 256 MiB of nothing.
  constexpr std::size_t points = 1 << 16, rest = 1 << 12;
  std::string columns;
  for (const float value : {1.f, 2.f, 3.f})
    for (std::size_t i = 0; i < points; ++i) columns += little(value + static_cast<float>(i));
  const std::size_t meaning = columns.size();
  std::string file = "FIELDS x y z rest\nSIZE 4 4 4 1\nTYPE F F F U\nCOUNT 1 1 1 " + std::to_string(rest) +
                     "\nWIDTH " + std::to_string(points) + "\nHEIGHT 1\nDATA binary_compressed\n";
  // Packed by hand: to have it all in memory would hide what the reader takes.
  std::string block;
  for (std::size_t at = 0; at < meaning; at += 32) block += '\x1f' + columns.substr(at, 32);
  block += std::string("\0\0", 2);
  std::size_t left = points * rest - 1;
  for (; left >= 264; left -= 264) block += "\xe0\xff" + std::string(1, '\0');
  for (; left > 0; --left) block += std::string("\0\0", 2);
  file +=
      little(static_cast<std::uint32_t>(block.size()), static_cast<std::uint32_t>(meaning + points * rest)) +
      block;
  const std::uint64_t before = peak_bytes();
  const auto read = pcd(file);
  ASSERT_TRUE(read) << message(read);
  ASSERT_EQ(read->cloud.size(), points);
  EXPECT_EQ(read->cloud.positions.back(), (Vec3d{65536, 65537, 65538}));
  EXPECT_LT(peak_bytes() - before, std::uint64_t{32} << 20);
}

TEST(Pcd, TakesTheFirstOfSeveralValues) {
  const std::string header =
      "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 2 1 3\nWIDTH 2\nHEIGHT 1\nDATA binary_compressed\n";
  const auto read =
      pcd(header + stored(little(1.f, -1.f, 4.f, -1.f, 2.f, 5.f, 3.f, -1.f, -1.f, 6.f, -1.f, -1.f)));
  ASSERT_TRUE(read) << message(read);
  EXPECT_EQ(read->cloud.positions, (std::vector<Vec3d>{{1, 2, 3}, {4, 5, 6}}));
}

TEST(Pcd, BoundsPointsThatRepeat) {
  const auto file = [](std::uint32_t points) {
    return "FIELDS x y z\nSIZE 1 1 1\nTYPE U U U\nWIDTH " + std::to_string(points) +
           "\nHEIGHT 1\nDATA binary_compressed\n" + compressed(std::string(3 * std::size_t{points}, '\1'));
  };
  const std::uint32_t most = 1 << 22;
  const auto read = pcd(file(most));
  ASSERT_TRUE(read) << message(read);
  EXPECT_EQ(read->cloud.size(), most);
  EXPECT_NE(message(pcd(file(most + 1))).find("more than 4194304 need a byte each"), std::string::npos)
      << message(pcd(file(most + 1)));
}

}  // namespace
}  // namespace bitr::io
