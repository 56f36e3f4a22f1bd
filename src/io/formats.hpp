// One parser per format, all of the same shape: bytes and a name for errors in, a Geometry out.
#pragma once

#include <bitr/io.hpp>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace bitr::io {

class Mover;

/// The whole content of one file. `name` only labels errors.
struct File {
  std::span<const std::byte> bytes;
  std::string_view name;
  Mover* mover = nullptr;    ///< to be told where points and normals stand, if there is one
  bool strict = false;       ///< holes are refused
  bool bare_points = false;  ///< some points may have no normal where others have one

  std::string_view text() const { return {reinterpret_cast<const char*>(bytes.data()), bytes.size()}; }
};

Result<Geometry> parse_ply(const File& file);
Result<Geometry> parse_pcd(const File& file);
Result<Geometry> parse_text(const File& file);
Result<Geometry> parse_npy(const File& file);
Result<Geometry> parse_obj(const File& file);
Result<Geometry> parse_off(const File& file);
Result<Geometry> parse_stl(const File& file);

/// With its dot, in small letters.
std::string extension_of(const std::filesystem::path& path);

/// The parser of the format.
Result<Geometry> parse_file(const File& file, CloudFormat format);

/// `invalid_argument` for NaN or infinite values, and for normals or colours that are not one per point.
Result<std::vector<std::byte>> serialize_ply(const PointCloud& cloud, PlyEncoding encoding);

/// What write_ply puts in the file; `path` only labels errors, which are those of serialize_ply, and `io`
/// when it does not fit in memory.
Result<std::vector<std::byte>> ply_file(const std::filesystem::path& path, const PointCloud& cloud,
                                        PlyEncoding encoding = PlyEncoding::binary_little_endian);

/// What move_cloud_file puts in the file.
Result<std::vector<std::byte>> moved_file(const std::filesystem::path& in, const std::filesystem::path& out,
                                          const Pose& T);

}  // namespace bitr::io
