// Shapes from files.
#pragma once

#include <bitr/generate.hpp>
#include <bitr/io.hpp>
#include <cstdint>
#include <filesystem>

namespace bitr::data {

/// What of a file is needed to draw samples of it: centred, and as large as a generated shape.
class FileShape {
 public:
  struct Needs {
    std::size_t points;  ///< as many as the largest sample has
    bool normals;
  };
  /// `bad_file` and the reader's other errors when the file has nothing to draw from, or too little.
  static Result<FileShape> read(const std::filesystem::path& path, const Needs& needs);

  /// `count` points for each side, not yet separated: the same sample twice, or two that have no point in
  /// common unless the file has less than 2·count.
  Result<GeneratedPair> sample_twice(std::size_t count, bool same_points, std::uint64_t seed) const;
  std::size_t bytes() const;

 private:
  PointCloud cloud_;  ///< or, if it is empty, …
  Mesh mesh_;
};

}  // namespace bitr::data
