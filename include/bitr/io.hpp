// Files: point clouds and meshes in, clouds out. Readers trust nothing a file says about itself: a length is
// checked against the bytes that are really there before it is used, and errors name the file, the byte offset
// (or the line) and the limit.
#pragma once

#include <bitr/cloud.hpp>
#include <bitr/result.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>

namespace bitr::io {

/// Formats are chosen by the file's extension, case-insensitively:
///   .ply  ascii, binary little and big endian; vertices, normals, colours, faces
///   .pcd  ascii, binary, binary_compressed; x y z, normal_x/y/z, rgb
///   .xyz .txt .csv  three or six numbers a line (or a header that names the columns)
///   .npy  N×3 or N×6 (positions, normals), little-endian f4 or f8, C order
///   .obj .off .stl  meshes
enum class CloudFormat { ply, pcd, text, npy, obj, off, stl };

/// `unsupported` when the extension is not one of the above.
Result<CloudFormat> cloud_format(const std::filesystem::path& path);

/// What a file holds: a cloud, or (when it has faces) a mesh.
struct Geometry {
  PointCloud cloud;  ///< the points; for a mesh, its vertices
  Mesh mesh;         ///< empty triangles when the file has no faces
  bool is_mesh() const { return !mesh.triangles.empty(); }
};

struct ReadOptions {
  std::size_t mesh_points = 2048;  ///< points to sample when the file is a mesh
  std::uint64_t seed = 0;          ///< of that sampling
};

/// Parses bytes already in memory; `name` only labels errors. Rejects NaN and infinite coordinates.
Result<Geometry> parse_geometry(std::span<const std::byte> bytes, CloudFormat format, std::string_view name);

/// Reads a whole file. `io` when it cannot be opened or read, `bad_file` when its content is wrong.
Result<Geometry> read_geometry(const std::filesystem::path& path);

/// Reads a cloud; a mesh is sampled uniformly by area (see sample_mesh).
Result<PointCloud> read_cloud(const std::filesystem::path& path, const ReadOptions& options = {});

/// `count` points uniform by area over the mesh, with unit face normals; same seed, same points.
/// `bad_file`-free: `invalid_argument` when the mesh has no area or count is 0.
Result<PointCloud> sample_mesh(const Mesh& mesh, std::size_t count, std::uint64_t seed);

/// `count` distinct points drawn without replacement, in their original order; the cloud itself when it is not
/// larger. Same seed, same points.
PointCloud subsample(const PointCloud& cloud, std::size_t count, std::uint64_t seed);

enum class PlyEncoding { ascii, binary_little_endian };

/// Writes positions (as float when exactly representable, else double), normals and colours (8 bit) if present.
/// Written to a temporary beside `path` and renamed, so a failure leaves nothing half-written.
Result<void> write_ply(const std::filesystem::path& path, const PointCloud& cloud,
                       PlyEncoding encoding = PlyEncoding::binary_little_endian);

/// Writes `bytes` atomically: temporary file in the same folder, flush, rename.
Result<void> write_file(const std::filesystem::path& path, std::span<const std::byte> bytes);

/// Reads a whole file into memory.
Result<std::vector<std::byte>> read_file(const std::filesystem::path& path);

}  // namespace bitr::io
