// Tables of numbers: XYZ, TXT, CSV and NPY.
#include <gtest/gtest.h>

#include "io/cloud_bytes.hpp"

namespace bitr::io {
namespace {

Result<Geometry> table(const std::string& content, const ReadOptions& options = {}) {
  return parse(content, CloudFormat::text, options);
}
Result<Geometry> npy(const std::string& content, const ReadOptions& options = {}) {
  return parse(content, CloudFormat::npy, options);
}

TEST(TextCloud, TakesEverySeparator) {
  for (const char* content : {"1 2 3\n-4.5 .25 1e3", "1,2,3\n-4.5,.25,1e3\n", "1\t2\t3\r\n-4.5\t.25\t1e3\r\n",
                              "1;2;3\n-4.5;.25;+1E3\n", "  1 , 2 , 3 \n\n -4.5 ,0.25,1000.0,\n",
                              "# x y z\n1 2 3 # first\n// second\n-4.5 .25 1e3 // last\n",
                              "\xef\xbb\xbf"
                              "1 2 3\n-4.5 .25 1e3\n"}) {
    const auto read = table(content);
    ASSERT_TRUE(read) << content << message(read);
    EXPECT_EQ(read->cloud.positions, two_points) << content;
    EXPECT_TRUE(read->cloud.normals.empty());
  }
}

TEST(TextCloud, SixColumnsAreNormalsAndOtherExtrasAreNothing) {
  const auto six = table("1 2 3 0 0 1\n-4.5 .25 1e3 0 0.6 0.8\n");
  ASSERT_TRUE(six) << message(six);
  EXPECT_EQ(six->cloud.positions, two_points);
  EXPECT_EQ(six->cloud.normals, (std::vector<Vec3f>{{0, 0, 1}, {0, 0.6f, 0.8f}}));
  for (const char* content : {"1 2 3 17\n-4.5 .25 1e3 18\n", "1 2 3 a b c 7\n-4.5 .25 1e3 d e f 8\n"}) {
    const auto read = table(content);
    ASSERT_TRUE(read) << message(read);
    EXPECT_EQ(read->cloud.positions, two_points);
    EXPECT_TRUE(read->cloud.normals.empty());
  }
  EXPECT_EQ(message(table("1 2 3 255 0 0\n")),
            "scan.dat: line 1: point 0: columns 4 to 6 have length 255, so they are not unit normals; a "
            "header line "
            "such as x,y,z,r,g,b says what they are");
}

TEST(TextCloud, AHeaderNamesTheColumns) {
  const auto read = table(
      "# a comment first\n\"time\", NZ, nx,ny, Z,y,x , r,g,b, name\n0,2,0,0, 3,2,1, 255,51,0, "
      "first\n0,0,1,0, "
      "1e3,.25,-4.5, 0,0,0, second\n");
  ASSERT_TRUE(read) << message(read);
  EXPECT_EQ(read->cloud.positions, two_points);
  EXPECT_EQ(read->cloud.normals, (std::vector<Vec3f>{{0, 0, 1}, {1, 0, 0}}));
  EXPECT_FLOAT_EQ(read->cloud.colors.at(0)[1], 0.2f);
  EXPECT_EQ(message(table("reading, gT00\ncloud.csv, 1\n")),
            "scan.dat: line 1: \"reading, gT00\" is neither numbers nor column names with x, y and z");
}

TEST(TextCloud, MessagesNameTheLine) {
  EXPECT_EQ(message(table("1 2 3\n4 5\n")), "scan.dat: line 2: 2 columns; the first line has 3");
  EXPECT_EQ(message(table("1 2 3\n4 5 6 7\n")), "scan.dat: line 2: 4 columns; the first line has 3");
  EXPECT_EQ(message(table("1 2 3\n\n4 five 6\n")),
            "scan.dat: line 3: column 2 is \"five\", not a finite number");
  EXPECT_EQ(message(table("1,,3\n")), "scan.dat: line 1: column 2 is \"\", not a finite number");
  EXPECT_EQ(message(table("1 2 inf\n", strict)),
            "scan.dat: line 1: point 0: z is inf; coordinates must be finite");
  EXPECT_EQ(message(table("1 2\n")), "scan.dat: line 1: 2 columns; x, y and z need 3");
  EXPECT_EQ(message(table("x y z\n")), "scan.dat: no points");
  EXPECT_EQ(message(table("# nothing\n")), "scan.dat: no points");
}

TEST(TextCloud, TinyNumbersAreZeroAndHugeOnesAreRefused) {
  const auto read = table("1e-400 -1e-5000x 3\n");
  EXPECT_FALSE(read);
  const auto tiny = table("1e-400 4.9e-324 3\n");
  ASSERT_TRUE(tiny) << message(tiny);
  EXPECT_EQ(tiny->cloud.positions[0], (Vec3d{0, 4.9e-324, 3}));
  EXPECT_FALSE(table("1e400 0 0\n"));
}

std::string npy_file(int major, std::string dictionary, const std::string& data) {
  dictionary += std::string(64 - dictionary.size() % 64, ' ') + "\n";
  std::string out = "\x93NUMPY" + std::string{static_cast<char>(major), '\0'};
  out += major == 1 ? little(static_cast<std::uint16_t>(dictionary.size()))
                    : little(static_cast<std::uint32_t>(dictionary.size()));
  return out + dictionary + data;
}

TEST(Npy, ReadsBothTypesInEveryVersion) {
  const std::string f4 = little(1.f, 2.f, 3.f, -4.5f, .25f, 1e3f), f8 = little(1., 2., 3., -4.5, .25, 1e3);
  for (int major = 1; major <= 3; ++major) {
    const auto single =
        npy(npy_file(major, "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }", f4));
    const auto twice =
        npy(npy_file(major, "{\"shape\":(2,3,),\"fortran_order\":False,\"descr\":\"<f8\"}", f8));
    for (const auto* read : {&single, &twice}) {
      ASSERT_TRUE(*read) << message(*read);
      EXPECT_EQ((*read)->cloud.positions, two_points);
    }
  }
}

TEST(Npy, SixColumnsHoldNormals) {
  const std::string shape = "{'descr': '<f4', 'fortran_order': False, 'shape': (1, 6), }";
  const auto read = npy(npy_file(1, shape, little(1.f, 2.f, 3.f, 0.f, 0.f, -1.f)));
  ASSERT_TRUE(read) << message(read);
  EXPECT_EQ(read->cloud.normals.at(0), (Vec3f{0, 0, -1}));
  EXPECT_NE(message(npy(npy_file(1, shape, little(1.f, 2.f, 3.f, 255.f, 0.f, 0.f)))).find("not unit normals"),
            std::string::npos);
}

TEST(Npy, RefusesWhatItWouldMisread) {
  const std::string data(24, '\0');
  const auto error = [&](const std::string& dictionary) {
    const auto read = npy(npy_file(1, dictionary, data));
    return read ? "" : std::string(name(read.error().code)) + ": " + read.error().message;
  };
  EXPECT_EQ(error("{'descr': '>f4', 'fortran_order': False, 'shape': (2, 3), }"),
            "unsupported: scan.dat: descr \">f4\"; only '<f4' and '<f8' (little-endian floats) are read");
  EXPECT_EQ(error("{'descr': '<i8', 'fortran_order': False, 'shape': (1, 3), }"),
            "unsupported: scan.dat: descr \"<i8\"; only '<f4' and '<f8' (little-endian floats) are read");
  EXPECT_EQ(error("{'descr': [('x', '<f4')], 'fortran_order': False, 'shape': (2,), }"),
            "unsupported: scan.dat: descr \"[('x', '<f4')]\"; only '<f4' and '<f8' (little-endian floats) "
            "are read");
  EXPECT_EQ(error("{'descr': '<f4', 'fortran_order': True, 'shape': (2, 3), }"),
            "unsupported: scan.dat: fortran_order \"True\"; only C order (False) is read");
  EXPECT_EQ(error("{'descr': '<f4', 'fortran_order': False, 'shape': (6,), }"),
            "bad_file: scan.dat: shape \"(6,)\"; a cloud is (N, 3), or (N, 6) with normals");
  EXPECT_EQ(error("{'descr': '<f4', 'fortran_order': False, 'shape': (3, 3), }"),
            "bad_file: scan.dat: byte 75: 3 rows of 3 need 36 bytes, 24 remain");
  EXPECT_EQ(error("{'descr': '<f4', 'fortran_order': False, 'shape': (6148914691236517206, 3), }"),
            "bad_file: scan.dat: byte 139: 6148914691236517206 rows of 3 need over 2^64 bytes, 24 remain");
  EXPECT_NE(error("{'descr': '<f4', 'shape': (2, 3), }").find("is not a dictionary"), std::string::npos);
}

}  // namespace
}  // namespace bitr::io
