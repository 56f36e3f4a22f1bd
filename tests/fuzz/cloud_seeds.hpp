// Small files, each good, that between them use every feature the cloud and mesh parsers read.
#pragma once

#include <lzf.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace bitr::io {

struct CloudSeed {
  std::string parser, file, bytes;  ///< `parser` is a CloudFormat's name
};

namespace seeds {

template <class... Values>
std::string packed(bool swap, Values... values) {
  std::string out;
  const auto add = [&](auto value) {
    std::string bytes(sizeof value, '\0');
    std::memcpy(bytes.data(), &value, sizeof value);
    out += swap ? std::string(bytes.rbegin(), bytes.rend()) : bytes;
  };
  (add(values), ...);
  return out;
}

inline std::string ply(bool swap) {
  const std::string header =
      " 1.0\ncomment two points and a face\nelement mark 1\nproperty list uchar short tags\nelement vertex "
      "3\nproperty float x\nproperty double y\nproperty short z\nproperty list uchar uint spare\nproperty "
      "float "
      "nx\nproperty float ny\nproperty float nz\nproperty uchar red\nproperty uchar green\nproperty uchar "
      "blue\nelement face 2\nproperty list uchar int vertex_indices\nproperty uchar flag\nend_header\n";
  std::string out = std::string("ply\nformat binary_") + (swap ? "big" : "little") + "_endian" + header;
  const std::uint8_t none = 0, one = 1, three = 3, four = 4, full = 255;
  out += packed(swap, one, std::int16_t{5});
  for (const float i : {0.f, 1.f, 2.f}) {
    out += packed(swap, i, 0.5 * i * i, std::int16_t{-3}, one, 9u, 0.f, 0.f, -1.f, full, none, none);
  }
  return out + packed(swap, three, 0, 1, 2, none) + packed(swap, four, 0, 1, 2, 0, none);
}

inline std::string npy(int major, std::string dictionary, const std::string& data) {
  dictionary += "\n";
  std::string out = "\x93NUMPY" + std::string{static_cast<char>(major), '\0'};
  const auto size = static_cast<std::uint32_t>(dictionary.size());
  out += major == 1 ? packed(false, static_cast<std::uint16_t>(size)) : packed(false, size);
  return out + dictionary + data;
}

inline std::string pcd_compressed() {
  std::string columns, block(2048, '\0');
  for (int k = 0; k < 4; ++k) {
    for (int i = 0; i < 40; ++i) columns += packed(false, static_cast<float>(k * i / 8));
  }
  const auto size = static_cast<std::uint32_t>(columns.size());
  const std::uint32_t used = lzf_compress(columns.data(), size, block.data(), 2048);
  block.resize(used);
  return "VERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\nWIDTH 8\nHEIGHT 5\n"
         "POINTS 40\nDATA binary_compressed\n" +
         packed(false, used, size) + block;
}

inline std::string stl_binary() {
  std::string out(80, 'h');
  out += packed(false, 2u);
  for (const float z : {0.f, 1.f}) {
    out += packed(false, 0.f, 0.f, 1.f, 0.f, 0.f, z, 1.f, 0.f, z, 0.f, 1.f, 0.f, std::uint16_t{0});
  }
  return out;
}

}  // namespace seeds

inline std::vector<CloudSeed> cloud_seeds() {
  using namespace seeds;
  const std::string pcd_header =
      "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z normal_x normal_y normal_z rgb _\nSIZE 4 8 2 4 4 4 4 1\nTYPE F "
      "F I F F F "
      "U U\nCOUNT 1 1 1 1 1 1 1 2\nWIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA ";
  const std::string pcd_row =
      packed(false, 1.5f, -2.25, std::int16_t{7}, 0.f, 1.f, 0.f, 0x00ff8000u, std::uint16_t{0});
  const std::string square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
  return {
      {"ply", "ascii.ply",
       "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float "
       "z\nproperty uchar "
       "red\nproperty uchar green\nproperty uchar blue\nelement face 1\nproperty list uchar int "
       "vertex_index\nend_header\n0 0 0 255 0 9\n1 0 -1e-3 1 2 3\n0 1 .5 0 0 0\n3 0 1 2\n"},
      {"ply", "little.ply", ply(false)},
      {"ply", "big.ply", ply(true)},
      {"pcd", "ascii.pcd",
       pcd_header + "ascii\n1.5 -2.25 7 0 1 0 16744448 0 0\n0 0 1e-2 1 0 0 2.35e-38 1 2\n"},
      {"pcd", "binary.pcd", pcd_header + "binary\n" + pcd_row + pcd_row},
      {"pcd", "compressed.pcd", pcd_compressed()},
      {"text", "plain.xyz", "# scan\n1 2 3\n-4.5 .25 1e3 // last\n"},
      {"text", "normals.txt", "1\t2\t3\t0\t0\t1\r\n4\t5\t6\t0.6\t0\t-0.8\r\n"},
      {"text", "named.csv", "x,y,z,nx,ny,nz,r,g,b,name\n1 , 2,3,0,0,2,255,0,1,a\n4;5;6;1;0;0;0;0;0;b\n"},
      {"npy", "f4.npy",
       npy(1, "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }",
           packed(false, 1.f, 2.f, 3.f, 4.f, 5.f, 6.f))},
      {"npy", "f8.npy",
       npy(2, "{'descr': '<f8', 'fortran_order': False, 'shape': (1, 6), }",
           packed(false, 1., 2., 3., 0., 0., 1.))},
      {"obj", "faces.obj",
       "# square\no a\n" + square + "vt 0 0\nvn 0 0 1\nf 1/1/1 2//1 -2 \\\n -1\nf 3 4/1 1\n"},
      {"obj", "points.obj", "vn 0 0 1\nv 1 2 3 1 .5 0\nvn 0 1 0\nv 4 5 6 0 0 0\n"},
      {"off", "plain.off", "OFF\n# square\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n3 0 1 2 255 0 0\n"},
      {"off", "full.off",
       "CNOFF3 1 0\n0 0 0 0 0 1 255 0 0 255\n1 0 0 0 0 1 0 9 0 255\n0 1 0 0 0 1 0 0 9 255\n3 0 1 2\n"},
      {"stl", "binary.stl", stl_binary()},
      {"stl", "ascii.stl",
       "solid a\nfacet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 1 0 0\n  vertex 0 1 -1e-3\n "
       "endloop\nendfacet\nendsolid a\n"},
  };
}

}  // namespace bitr::io
