// A folder of shapes for data sets to read.
#pragma once

#include <gtest/gtest.h>
#include <stdlib.h>

#include <bitr/generate.hpp>
#include <bitr/io.hpp>
#include <filesystem>
#include <fstream>
#include <string>

namespace bitr::test {

/// Fresh, and removed with everything in it at the end.
class ShapeFolder {
 public:
  ShapeFolder() {
    std::string pattern = (std::filesystem::temp_directory_path() / "bitr_data_XXXXXX").string();
    EXPECT_NE(mkdtemp(pattern.data()), nullptr);
    root_ = pattern;
  }
  ~ShapeFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(root_, ignored);
  }
  ShapeFolder(const ShapeFolder&) = delete;
  ShapeFolder& operator=(const ShapeFolder&) = delete;

  const std::filesystem::path& path() const { return root_; }

  void write(const std::string& name, const std::string& content) const {
    std::filesystem::create_directories((root_ / name).parent_path());
    std::ofstream(root_ / name, std::ios::binary) << content;
  }
  /// A box far from the origin, of the given width, as a mesh.
  void write_box(const std::string& name, double width) const {
    std::string off = "OFF\n8 6 12\n";
    for (int i = 0; i < 8; ++i)
      off += std::to_string(100 + (i & 1) * width) + " " + std::to_string((i >> 1 & 1) * 20) + " " +
             std::to_string((i >> 2 & 1) * 10) + "\n";
    off += "4 0 2 3 1\n4 4 5 7 6\n4 0 1 5 4\n4 2 6 7 3\n4 0 4 6 2\n4 1 3 7 5\n";
    write(name, off);
  }
  void write_cloud(const std::string& name, std::size_t points, bool normals) const {
    std::filesystem::create_directories((root_ / name).parent_path());
    PointCloud cloud = generate_shape("solids", points, points).value().cloud;
    if (!normals) cloud.normals.clear();
    EXPECT_TRUE(io::write_ply(root_ / name, cloud).has_value());
  }

 private:
  std::filesystem::path root_;
};

}  // namespace bitr::test
