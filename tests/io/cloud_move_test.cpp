// A moved file against the file that a generator writes for the moved numbers: equal byte for byte.
#include <gtest/gtest.h>
#include <lzf.h>

#include <unistd.h>

#include <charconv>
#include <cmath>
#include <filesystem>
#include <functional>
#include <map>

#include "fuzz/cloud_seeds.hpp"
#include "io/cloud_bytes.hpp"
#include "io/formats.hpp"
#include "support/random_motion.hpp"

namespace bitr::io {
namespace {

struct Numbers {
  std::vector<Vec3d> points, normals;
};

template <class T>
std::string digits(T value) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, value).ptr};
}

/// What is read of a number that a file holds as a double, a float, or a float's digits.
enum class Kept { doubles, floats, digits };
double kept(double value, Kept how) {
  if (how == Kept::doubles) return value;
  const auto single = static_cast<float>(value);
  return how == Kept::floats ? static_cast<double>(single) : std::stod(digits(single));
}

Numbers random_numbers(Random& random, std::size_t count, Kept points, Kept normals) {
  Numbers numbers;
  const auto value = [&](double scale) { return kept(scale * random.uniform(-1, 1), points); };
  for (std::size_t i = 0; i < count; ++i) {
    numbers.points.push_back({value(100), value(1), value(0.001)});
    const auto r = random.rotation();
    Vec3d normal = {r[0], r[1], r[2]};
    for (double& v : normal) v = kept(v, normals);
    numbers.normals.push_back(normal);
  }
  return numbers;
}

Numbers moved(const Numbers& numbers, const Pose& T) {
  Numbers result;
  for (const Vec3d& p : numbers.points) result.points.push_back(T.apply(p));
  for (const Vec3d& n : numbers.normals) result.normals.push_back(T.rotate(n));
  return result;
}

std::string digits(double value, bool doubles) {
  return doubles ? digits(value) : digits(static_cast<float>(value));
}
std::string bytes(double value, bool doubles, std::endian order = std::endian::little) {
  return doubles ? raw(order, value) : raw(order, static_cast<float>(value));
}

Result<std::vector<std::byte>> move(const std::string& content, CloudFormat format, const Pose& T) {
  const std::vector<char> exact(content.begin(), content.end());
  return moved_geometry(std::as_bytes(std::span(exact)), format, "scan.dat", T);
}
std::string text_of(const std::vector<std::byte>& content) {
  return {reinterpret_cast<const char*>(content.data()), content.size()};
}

/// `write` makes a file of numbers; everything else in it is the same at every call.
void expect_moves(CloudFormat format, Kept how, const std::function<std::string(const Numbers&)>& write) {
  Random random(7);
  for (const std::size_t count : {1, 2, 3, 30}) {
    const Numbers numbers = random_numbers(random, count, how, how);
    for (const Pose& T : {Pose{}, test::random_pose(random, 50), test::random_pose(random)}) {
      const std::string file = write(numbers);
      ASSERT_TRUE(parse(file, format)) << message(parse(file, format));
      const auto result = move(file, format, T);
      ASSERT_TRUE(result) << message(result);
      EXPECT_EQ(text_of(*result), write(moved(numbers, T)));
    }
  }
}

std::string ply(const Numbers& numbers, const std::string& format, bool doubles) {
  const std::string type = doubles ? "double " : "float ";
  std::string file = "ply\r\nformat " + format + " 1.0\ncomment  of  a scan\nobj_info 1\nelement camera 1\n" +
                     "property float x\nproperty list uchar int ids\nelement vertex " +
                     std::to_string(numbers.points.size()) + "\nproperty uchar red\nproperty " + type +
                     "z\nproperty list ushort short near\nproperty float nx\nproperty float ny\n" +
                     "property float nz\nproperty float quality\nproperty " + type +
                     "y\nproperty uchar green\nproperty uchar blue\nproperty " + type +
                     "x\nproperty int label\nelement face 1\nproperty list uchar int vertex_indices\n" +
                     "property float nx\nproperty float ny\nproperty float nz\nproperty uchar flags\n" +
                     "end_header\n";
  const bool ascii = format == "ascii";
  const std::endian order = format == "binary_big_endian" ? std::endian::big : std::endian::little;
  std::string row;
  const auto put = [&](auto value) {
    if (ascii)
      row += (row.empty() ? "" : " ") + digits(value);
    else
      row += raw(order, value);
  };
  const auto end = [&] { file += row + (ascii ? "\n" : ""), row.clear(); };
  const auto coordinate = [&](double value) { doubles ? put(value) : put(static_cast<float>(value)); };
  const auto normal = [&](const Vec3d& n) {
    for (const double v : n) put(static_cast<float>(v));
  };
  // The camera's x is not a point's.
  put(1.5F), put(std::uint8_t{1}), put(77), end();
  Random random(3);
  for (std::size_t i = 0; i < numbers.points.size(); ++i) {
    const Vec3d& p = numbers.points[i];
    put(static_cast<std::uint8_t>(random.uniform(0, 255))), coordinate(p[2]);
    put(static_cast<std::uint16_t>(i % 3));
    for (std::size_t k = 0; k < i % 3; ++k) put(static_cast<std::int16_t>(random.uniform(-9, 9)));
    normal(numbers.normals[i]);
    put(static_cast<float>(random.uniform(-1, 1))), coordinate(p[1]);
    put(std::uint8_t{200}), put(std::uint8_t{3}), coordinate(p[0]), put(static_cast<int>(i) - 5), end();
  }
  put(std::uint8_t{3}), put(0), put(0), put(0), normal(numbers.normals[0]), put(std::uint8_t{9}), end();
  return file;
}

TEST(MoveCloud, PlyKeepsEveryOtherProperty) {
  for (const char* format : {"ascii", "binary_little_endian", "binary_big_endian"})
    for (const bool doubles : {false, true}) {
      const auto write = [&](const Numbers& numbers) { return ply(numbers, format, doubles); };
      const Kept single = std::string(format) == "ascii" ? Kept::digits : Kept::floats;
      Random random(11);
      for (int i = 0; i < 5; ++i) {
        const Numbers numbers = random_numbers(random, 20, doubles ? Kept::doubles : single, single);
        const Pose T = test::random_pose(random, 10);
        const auto result = move(write(numbers), CloudFormat::ply, T);
        ASSERT_TRUE(result) << message(result);
        EXPECT_EQ(text_of(*result), write(moved(numbers, T))) << format;
      }
    }
}

std::string pcd_header(std::size_t count, bool doubles, const std::string& data) {
  const std::string size = doubles ? "8" : "4", n = std::to_string(count);
  return "# .PCD v0.7\nVERSION 0.7\nFIELDS intensity x label y z rgb normal_x normal_y normal_z hist\nSIZE "
         "4 " +
         size + " 2 " + size + " " + size + " 4 " + size + " " + size + " " + size +
         " 1\nTYPE F F U F F U F F F I\nCOUNT 1 1 1 1 1 1 1 1 1 3\nWIDTH " + n +
         "\nHEIGHT 1\nVIEWPOINT 1 2 3 1 0 0 0\nPOINTS " + n + "\nDATA " + data + "\n";
}

/// Every value of every point; `value(bytes, digits)` says how each is written.
template <class Put>
void pcd_row(const Numbers& numbers, std::size_t i, bool doubles, const Put& put) {
  const Vec3d &p = numbers.points[i], &n = numbers.normals[i];
  const auto triple = [&](double v) { put(bytes(v, doubles), digits(v, doubles)); };
  put(little(0.5F * static_cast<float>(i)), digits(0.5F * static_cast<float>(i)));
  triple(p[0]);
  put(little(static_cast<std::uint16_t>(i)), digits(i));
  triple(p[1]), triple(p[2]);
  put(little(std::uint32_t{0x00102030}), digits(0x00102030));
  for (const double v : n) triple(v);
  put(little(std::int8_t{1}, std::int8_t{-2}, static_cast<std::int8_t>(i)), "1 -2 " + digits(i));
}

TEST(MoveCloud, PcdInTextAndRows) {
  for (const bool doubles : {false, true}) {
    expect_moves(CloudFormat::pcd, doubles ? Kept::doubles : Kept::digits, [&](const Numbers& numbers) {
      std::string file = pcd_header(numbers.points.size(), doubles, "ascii");
      for (std::size_t i = 0; i < numbers.points.size(); ++i) {
        std::string row;
        pcd_row(numbers, i, doubles,
                [&](const std::string&, const std::string& text) { row += (row.empty() ? "" : " ") + text; });
        file += row + "\n";
      }
      return file;
    });
    expect_moves(CloudFormat::pcd, doubles ? Kept::doubles : Kept::floats, [&](const Numbers& numbers) {
      std::string file = pcd_header(numbers.points.size(), doubles, "binary");
      for (std::size_t i = 0; i < numbers.points.size(); ++i)
        pcd_row(numbers, i, doubles, [&](const std::string& value, const std::string&) { file += value; });
      return file + "and what follows";
    });
  }
}

TEST(MoveCloud, PcdInCompressedColumns) {
  Random random(5);
  for (const bool doubles : {false, true})
    for (const std::size_t count : {1, 2, 50, 400}) {
      const auto columns = [&](const Numbers& numbers) {
        std::vector<std::string> fields(10);
        for (std::size_t i = 0; i < count; ++i) {
          std::size_t field = 0;
          pcd_row(numbers, i, doubles,
                  [&](const std::string& value, const std::string&) { fields[field++] += value; });
        }
        std::string table;
        for (const std::string& field : fields) table += field;
        return table;
      };
      const Kept how = doubles ? Kept::doubles : Kept::floats;
      const Numbers numbers = random_numbers(random, count, how, how);
      const std::string header = pcd_header(count, doubles, "binary_compressed"), table = columns(numbers);
      std::string packed(2 * table.size() + 64, '\0');
      packed.resize(lzf_compress(table.data(), static_cast<unsigned>(table.size()), packed.data(),
                                 static_cast<unsigned>(packed.size())));
      const auto u32 = [](std::size_t n) { return static_cast<std::uint32_t>(n); };
      const std::string file = header + little(u32(packed.size()), u32(table.size())) + packed + "tail";
      const Pose T = test::random_pose(random, 10);
      const auto result = move(file, CloudFormat::pcd, T);
      ASSERT_TRUE(result) << message(result);

      const std::string out = text_of(*result);
      ASSERT_TRUE(out.starts_with(header));
      ASSERT_TRUE(out.ends_with("tail"));
      std::uint32_t sizes[2];
      std::memcpy(sizes, out.data() + header.size(), 8);
      ASSERT_EQ(out.size(), header.size() + 8 + sizes[0] + 4);
      ASSERT_EQ(sizes[1], table.size());
      std::string unpacked(table.size(), '\0');
      ASSERT_EQ(lzf_decompress(out.data() + header.size() + 8, sizes[0], unpacked.data(), sizes[1]),
                sizes[1]);
      EXPECT_EQ(unpacked, columns(moved(numbers, T)));
    }
}

TEST(MoveCloud, Npy) {
  for (const bool doubles : {false, true})
    for (const bool normals : {false, true})
      expect_moves(CloudFormat::npy, doubles ? Kept::doubles : Kept::floats, [&](const Numbers& numbers) {
        std::string dictionary =
            std::string("{'descr': '<f") + (doubles ? "8" : "4") + "', 'fortran_order': False, 'shape': (" +
            std::to_string(numbers.points.size()) + ", " + (normals ? "6" : "3") + "), }";
        dictionary.resize(117, ' ');
        std::string file =
            "\x93NUMPY" + little(std::uint8_t{1}, std::uint8_t{0}, std::uint16_t{118}) + dictionary + "\n";
        for (std::size_t i = 0; i < numbers.points.size(); ++i) {
          for (const double v : numbers.points[i]) file += bytes(v, doubles);
          if (normals)
            for (const double v : numbers.normals[i]) file += bytes(v, doubles);
        }
        return file;
      });
}

TEST(MoveCloud, TablesKeepTheirColumnsAndSpaces) {
  expect_moves(CloudFormat::text, Kept::doubles, [](const Numbers& numbers) {
    std::string file = "\xef\xbb\xbf# a scan\r\nid;\"x\";y ; z;name;NX;ny;nz\r\n\r\n";
    for (std::size_t i = 0; i < numbers.points.size(); ++i) {
      const Vec3d &p = numbers.points[i], &n = numbers.normals[i];
      file +=
          digits(i) + ";" + digits(p[0]) + " ;" + digits(p[1]) + ";\t" + digits(p[2]) + ";point " + digits(i);
      // Two words in a cell would be two cells.
      file[file.rfind(' ')] = '_';
      file += ";" + digits(n[0]) + ";" + digits(n[1]) + ";" + digits(n[2]) + " # 1 2 3\r\n";
    }
    return file + "\n# the end";
  });
  for (const std::size_t more : {0, 1, 4})
    expect_moves(CloudFormat::text, Kept::doubles, [&](const Numbers& numbers) {
      std::string file = "// by hand\n";
      for (const Vec3d& p : numbers.points) {
        file += "  " + digits(p[0]) + " \t" + digits(p[1]) + " " + digits(p[2]);
        for (std::size_t k = 0; k < more; ++k) file += " 0.50";
        file += "\n";
      }
      return file;
    });
  expect_moves(CloudFormat::text, Kept::doubles, [](const Numbers& numbers) {
    std::string file;
    for (std::size_t i = 0; i < numbers.points.size(); ++i) {
      for (const double v : numbers.points[i]) file += digits(v) + ",";
      for (const double v : numbers.normals[i]) file += digits(v) + ",";
      file.back() = '\n';
    }
    return file;
  });
}

TEST(MoveCloud, NumbersSpelledInAnyWayAreReplacedWhole) {
  const Pose shift = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {1, 2, 3}};
  const auto result = move("+1.50e0 .25 1E3 7\n", CloudFormat::text, shift);
  ASSERT_TRUE(result);
  EXPECT_EQ(text_of(*result), "2.5 2.25 1003 7\n");
}

TEST(MoveCloud, ObjKeepsFacesColoursAndTheRest) {
  expect_moves(CloudFormat::obj, Kept::doubles, [](const Numbers& numbers) {
    std::string file = "mtllib a.mtl\n# v 1 2 3\no thing\n";
    for (const Vec3d& p : numbers.points)
      file += "v " + digits(p[0]) + " \\\n  " + digits(p[1]) + "  " + digits(p[2]) + " 0.25 0.5 0.75\n";
    file += "vt 0.5 0.5\n";
    for (const Vec3d& n : numbers.normals)
      file += "vn\t" + digits(n[0]) + " " + digits(n[1]) + " " + digits(n[2]) + "\n";
    return file + "usemtl red\ns off\nf 1/1/1 1//1 -1\nl 1 1\n";
  });
}

TEST(MoveCloud, OffInAllVariants) {
  for (const bool normals : {false, true})
    for (const bool colors : {false, true})
      expect_moves(CloudFormat::off, Kept::doubles, [&](const Numbers& numbers) {
        std::string file = std::string(colors ? "C" : "") + (normals ? "N" : "") + "OFF # a mesh\n" +
                           std::to_string(numbers.points.size()) + " 1 0\n";
        for (std::size_t i = 0; i < numbers.points.size(); ++i) {
          for (const double v : numbers.points[i]) file += digits(v) + " ";
          if (normals)
            for (const double v : numbers.normals[i]) file += digits(v) + " ";
          file += colors ? "0.5 0.25 1 1 # red\n" : "\n";
        }
        return file + "3 0 0 0  255 0 0\n";
      });
}

TEST(MoveCloud, StlMovesCornersAndTurnsFacets) {
  expect_moves(CloudFormat::stl, Kept::floats, [](const Numbers& numbers) {
    std::string header = "made by a scanner";
    header.resize(80, '\x7f');
    std::string file = header + little(static_cast<std::uint32_t>(numbers.points.size()));
    for (std::size_t i = 0; i < numbers.points.size(); ++i) {
      for (const double v : numbers.normals[i]) file += bytes(v, false);
      for (int corner = 0; corner < 3; ++corner)
        for (const double v : numbers.points[(i + corner) % numbers.points.size()]) file += bytes(v, false);
      file += little(static_cast<std::uint16_t>(i));
    }
    return file;
  });
  expect_moves(CloudFormat::stl, Kept::doubles, [](const Numbers& numbers) {
    std::string file = "solid  a thing\n";
    for (std::size_t i = 0; i < numbers.points.size(); ++i) {
      file += " facet normal";
      for (const double v : numbers.normals[i]) file += " " + digits(v);
      file += "\n  outer loop\n";
      for (int corner = 0; corner < 3; ++corner) {
        file += "   vertex";
        for (const double v : numbers.points[(i + corner) % numbers.points.size()]) file += "  " + digits(v);
        file += "\n";
      }
      file += "  endloop\n endfacet\n";
    }
    return file + "endsolid a thing\n";
  });
  // No direction, and none that is a number, stay.
  const std::string facet =
      "solid\nfacet normal nan 0 0\nouter loop\nvertex 0 0 0\nvertex 0 0 0\nvertex 0 0 "
      "0\nendloop\nendfacet\nendsolid\n";
  const auto result = move(facet, CloudFormat::stl, Pose{});
  ASSERT_TRUE(result) << message(result);
  EXPECT_EQ(text_of(*result), facet);
}

TEST(MoveCloud, WhatIsReadFromAMovedFileIsTheMovedCloud) {
  Random random(9);
  for (const auto& [parser, file, content] : cloud_seeds()) {
    const CloudFormat format = formats.at(parser);
    const auto before = parse(content, format);
    ASSERT_TRUE(before) << file;
    const Pose T = test::random_pose(random);
    const auto result = move(content, format, T);
    if (!result) {
      EXPECT_EQ(result.error().code, ErrorCode::unsupported) << file << message(result);
      continue;
    }
    const auto after = parse(text_of(*result), format);
    ASSERT_TRUE(after) << file << message(after);
    ASSERT_EQ(after->cloud.size(), before->cloud.size()) << file;
    EXPECT_EQ(after->cloud.colors, before->cloud.colors) << file;
    EXPECT_EQ(after->mesh.triangles, before->mesh.triangles) << file;
    ASSERT_EQ(after->cloud.normals.size(), before->cloud.normals.size()) << file;
    for (std::size_t i = 0; i < before->cloud.size(); ++i) {
      const Vec3d expected = T.apply(before->cloud.positions[i]);
      double size = 1;
      for (const double v : before->cloud.positions[i]) size = std::max(size, std::abs(v));
      for (int a = 0; a < 3; ++a) EXPECT_NEAR(after->cloud.positions[i][a], expected[a], 1e-6 * size) << file;
      if (before->cloud.normals.empty()) continue;
      const Vec3f& n = before->cloud.normals[i];
      const Vec3d turned = T.rotate({n[0], n[1], n[2]});
      for (int a = 0; a < 3; ++a) EXPECT_NEAR(after->cloud.normals[i][a], turned[a], 1e-6) << file;
    }
  }
}

TEST(MoveCloud, BadFilesAreRefusedAsAReaderRefusesThem) {
  Random random(4);
  for (const auto& [parser, file, content] : cloud_seeds())
    for (std::size_t size = 0; size < content.size(); ++size) {
      std::string bad = content.substr(0, size);
      if (size % 2 && size > 0) {
        bad = content;
        bad[size] = static_cast<char>(random.uniform(0, 256));
      }
      const auto read =
          parse_file({.bytes = std::as_bytes(std::span(bad)), .name = "scan.dat", .bare_points = true},
                     formats.at(parser));
      const auto result = move(bad, formats.at(parser), test::random_pose(random));
      if (!read) {
        ASSERT_FALSE(result) << file << " " << size;
      }
      if (result) continue;
      EXPECT_TRUE(result.error().message.starts_with("scan.dat: ")) << message(result);
      EXPECT_EQ(result.error().message.find('\n'), std::string::npos) << message(result);
    }
}

TEST(MoveCloud, RefusesIntegersAndWhatATypeCannotHold) {
  const std::string integers =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty int x\nproperty float y\nproperty float z\n"
      "end_header\n1 2 3\n";
  const auto integer = move(integers, CloudFormat::ply, Pose{});
  ASSERT_FALSE(integer);
  EXPECT_EQ(integer.error().code, ErrorCode::unsupported);
  EXPECT_NE(message(integer).find("integer type"), std::string::npos) << message(integer);

  std::string floats = integers;
  floats.replace(floats.find("int x"), 5, "float x");
  Pose far;
  far.translation[0] = 1e39;
  const auto large = move(floats, CloudFormat::ply, far);
  ASSERT_FALSE(large);
  EXPECT_EQ(large.error().code, ErrorCode::invalid_argument);
  EXPECT_EQ(message(large), "scan.dat: line 8: moved to 1e+39, which is beyond its type");
}

TEST(MoveCloud, AFileKeepsItsExtension) {
  const auto folder = std::filesystem::temp_directory_path() / ("bitr_move_" + std::to_string(::getpid()));
  std::filesystem::create_directory(folder);
  const std::string content = "1 2 3\n4 5 6\n";
  const auto in = folder / "scan.xyz";
  ASSERT_TRUE(write_file(in, std::as_bytes(std::span(content))));
  const Pose shift = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {1, 0, 0}};
  for (const char* name : {"moved.ply", "moved.csv", "moved"}) {
    const auto wrong = move_cloud_file(in, folder / name, shift);
    ASSERT_FALSE(wrong);
    EXPECT_EQ(wrong.error().code, ErrorCode::invalid_argument);
    EXPECT_NE(message(wrong).find("scan.xyz"), std::string::npos) << message(wrong);
    EXPECT_FALSE(std::filesystem::exists(folder / name));
    EXPECT_FALSE(check_move(in, folder / name));
  }
  EXPECT_TRUE(check_move(in, folder / "moved.XYZ"));
  EXPECT_FALSE(std::filesystem::exists(folder / "moved.XYZ"));
  ASSERT_TRUE(move_cloud_file(in, folder / "moved.XYZ", shift));
  EXPECT_EQ(text_of(read_file(folder / "moved.XYZ").value()), "2 2 3\n5 5 6\n");
  EXPECT_EQ(check_move(folder / "none.xyz", folder / "moved.xyz").error().code, ErrorCode::io);
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace bitr::io
