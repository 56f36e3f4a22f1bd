// What no parser may do with a bad file: crash, hang, take memory on the file's word, or fail without naming
// it.
#include <gtest/gtest.h>

#include <map>

#include "fuzz/cloud_seeds.hpp"
#include "io/cloud_bytes.hpp"

namespace bitr::io {
namespace {

void expect_named(const Error& error) {
  EXPECT_TRUE(error.message.starts_with("scan.dat: ")) << error.message;
  EXPECT_EQ(error.message.find('\n'), std::string::npos) << error.message;
  EXPECT_LT(error.message.size(), 500u);
  EXPECT_TRUE(error.code == ErrorCode::bad_file || error.code == ErrorCode::unsupported);
}

TEST(Malformed, EverySeedIsGood) {
  for (const auto& [parser, file, bytes] : cloud_seeds()) {
    const auto read = parse(bytes, formats.at(parser));
    EXPECT_TRUE(read) << file << ": " << message(read);
  }
}

TEST(Malformed, EveryTruncationIsAnErrorOrReadsFewerRows) {
  for (const auto& [parser, file, bytes] : cloud_seeds()) {
    const auto whole = parse(bytes, formats.at(parser));
    ASSERT_TRUE(whole) << file;
    for (std::size_t size = 0; size < bytes.size(); ++size) {
      const auto read = parse(bytes.substr(0, size), formats.at(parser));
      if (!read) {
        expect_named(read.error());
      } else {
        EXPECT_LE(read->cloud.size(), whole->cloud.size()) << file << " " << size;
      }
    }
  }
}

TEST(Malformed, BinaryTruncationsAreErrors) {
  for (const auto& [parser, file, bytes] : cloud_seeds()) {
    const bool binary = file == "little.ply" || file == "big.ply" || file == "binary.pcd" ||
                        file == "f4.npy" || file == "compressed.pcd" || file == "f8.npy" ||
                        file == "binary.stl";
    for (std::size_t size = 0; binary && size < bytes.size(); ++size) {
      EXPECT_FALSE(parse(bytes.substr(0, size), formats.at(parser))) << file << " " << size;
    }
  }
}

TEST(Malformed, JunkIsRefusedByEveryParser) {
  std::string every_byte;
  for (int i = 0; i < 1024; ++i) every_byte += static_cast<char>(i * 7);
  for (const auto& [name, format] : formats) {
    for (const std::string& junk :
         {std::string(), std::string("\n"), std::string(1000, '\0'), std::string(1000, '\xff'), every_byte,
          std::string(100000, '('), std::string(100000, 'x'), std::string("ply\n"), std::string("ply"),
          std::string("ply   "), std::string("ply\r"), std::string("\x93NUMPY"), std::string("solid"),
          std::string("OFF"), std::string("# .PCD v0.7\nVERSION 0.7\n")}) {
      const auto read = parse(junk, format);
      ASSERT_FALSE(read) << name;
      expect_named(read.error());
    }
  }
}

TEST(Malformed, AbsurdHeadersAreRefusedWithoutTheirMemory) {
  const std::string xyz = "property float x\nproperty float y\nproperty float z\n";
  const std::string pcd_fields = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\n";
  struct Case {
    const char* parser;
    std::string bytes, says;
  };
  const Case cases[] = {
      {"ply",
       "ply\nformat binary_little_endian 1.0\nelement vertex 18446744073709551615\n" + xyz +
           "end_header\n1234",
       "18446744073709551615 rows of \"vertex\" need over 2^64 bytes, 4 remain"},
      {"ply", "ply\nformat ascii 1.0\nelement vertex 4000000000\n" + xyz + "end_header\n0 0 0\n",
       "4000000000 rows of \"vertex\" need at least 24000000000 bytes, 6 remain"},
      {"ply", "ply\nformat ascii 1.0\nelement vertex 99999999999999999999\n" + xyz + "end_header\n",
       "line 3: \"99999999999999999999\" is not a count of \"vertex\""},
      {"ply", "ply\nformat ascii 1.0\nelement vertex -1\n" + xyz + "end_header\n", "\"-1\" is not a count"},
      {"ply", "ply\nformat ascii 1.0\nelement vertex 0\n" + xyz + "end_header\n", "no points"},
      {"ply",
       "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nend_header\n0 0\n",
       "the vertices have no x, y and z"},
      {"ply", "ply\nformat ascii 1.0\nelement vertex 1\n" + xyz + "property int x\nend_header\n0 0 0 0\n",
       "two properties mean \"x\""},
      {"ply", "ply\nformat ascii 1.0\nend_header\n", "the header declares 0 vertex elements, not one"},
      {"ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty vec3 x\nend_header\n",
       "\"vec3\" is not a PLY type"},
      {"ply", "ply\nelement vertex 1\n" + xyz + "end_header\n0 0 0\n", "no format line"},
      {"ply", "ply\nformat ascii 1.0\nelement vertex 1\n" + xyz, "no end_header line"},
      {"ply",
       "ply\nformat binary_little_endian 1.0\nelement vertex 1\n" + xyz +
           "element face 1\nproperty list int int vertex_index\nend_header\n" + little(0.f, 0.f, 0.f, -1),
       "a list of -1 values"},
      {"ply",
       "ply\nformat binary_little_endian 1.0\nelement vertex 1\n" + xyz +
           "element face 1\nproperty list uint int vertex_index\nend_header\n" +
           little(0.f, 0.f, 0.f, 4000000000u),
       "4000000000 values of \"vertex_index\" need 16000000000 bytes, 0 remain"},
      {"ply",
       "ply\nformat ascii 1.0\nelement vertex 1\n" + xyz +
           "element face 1\nproperty list int int vertex_index\nend_header\n0 0 0\n3 0 0 1\n",
       "line 11: a face uses vertex 1; there are 1"},
      {"ply",
       "ply\nformat ascii 1.0\nelement vertex 1\n" + xyz +
           "element face 1\nproperty list int int vertex_index\nend_header\n0 0 0\n1000000000000 0 0\n",
       "line 11: \"vertex_index\" announces 1000000000000 values and has 2"},
      {"pcd", pcd_fields + "WIDTH 4294967296\nHEIGHT 4294967296\nDATA binary\n", "points are over 2^64"},
      {"pcd", pcd_fields + "WIDTH 2\nHEIGHT 3\nPOINTS 5\nDATA ascii\n", "5 POINTS are not 2 x 3"},
      {"pcd", pcd_fields + "POINTS 18446744073709551615\nDATA binary\n", "need over 2^64 bytes, 0 remain"},
      {"pcd", pcd_fields + "POINTS 1000000000\nDATA ascii\n0 0 0\n",
       "need at least 6000000000 bytes, 6 remain"},
      {"pcd", pcd_fields + "COUNT 1 1 4294967295\nPOINTS 1\nDATA ascii\n0 0 0\n", "COUNT 4294967295"},
      {"pcd", pcd_fields + "COUNT 1 1 0\nPOINTS 1\nDATA ascii\n0 0 0\n", "COUNT 0"},
      {"pcd", "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 0\nDATA binary\n", "no points"},
      {"pcd", "FIELDS x y z\nSIZE 4 4 3\nTYPE F F F\nPOINTS 1\nDATA binary\n0123456789a", "is no number"},
      {"pcd", "FIELDS x y\nSIZE 4 4\nTYPE F F\nPOINTS 1\nDATA binary\n", "no fields x, y and z"},
      {"pcd", pcd_fields + "DATA binary\n", "neither POINTS nor WIDTH and HEIGHT"},
      {"obj", "v 0 0 0\nf 1 1 99999999999999999999\n",
       "line 2: \"99999999999999999999\" is not a face vertex"},
      {"obj", "v 0 0 0\nf 1 1 4294967296\n", "a face uses vertex 4294967296"},
      {"obj", "v 0 0 0\nf 1 1 -9223372036854775808\n", "a face uses vertex -9223372036854775808"},
      {"off", "OFF\n18446744073709551615 0 0\n", "need at least over 2^64 bytes"},
      {"off", "OFF\n-4 0 0\n", "are not counts"},
      {"stl", std::string(80, '\0') + little(0xffffffffu),
       "4294967295 triangles need 214748364750 bytes, 0 remain"},
      {"npy", std::string("\x93NUMPY\x02\x00\xff\xff\xff\xff", 12), "a header of 4294967295 bytes, 0 remain"},
      {"npy", std::string("\x93NUMPY\x09\x00\x00\x00", 10), "NPY version 9; versions 1 to 3 are read"},
  };
  for (const auto& [parser, bytes, says] : cases) {
    const auto read = parse(bytes, formats.at(parser));
    ASSERT_FALSE(read) << says;
    expect_named(read.error());
    EXPECT_NE(read.error().message.find(says), std::string::npos)
        << read.error().message << "\n  instead of " << says;
  }
}

TEST(Malformed, WordsFromTheFileStayPrintable) {
  const auto read = parse("ply\nformat as\x1b[31mcii\n", CloudFormat::ply);
  EXPECT_EQ(message(read), "scan.dat: line 2: \"as\\x1b[31mcii\" is not a PLY format");
}

}  // namespace
}  // namespace bitr::io
