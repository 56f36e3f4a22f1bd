// Files: point clouds and meshes in, clouds out. Readers trust nothing a file says about itself: a length is
// checked against the bytes that are really there before it is used, so that memory stays within a small
// multiple of the file's size. An error is one line that names the file, the byte offset or the line, the
// value and the limit: "scan.ply: byte 212: 4000000000 rows of "vertex" need 48000000000 bytes, 1024 remain".
#pragma once

#include <bitr/cloud.hpp>
#include <bitr/pose.hpp>
#include <bitr/result.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace bitr::io {

/// Formats are chosen by the file's extension, case-insensitively:
///   .ply  ascii, binary little and big endian; vertices, normals, colours, faces
///   .pcd  0.7: ascii, binary, binary_compressed; x y z, normal_x/y/z, rgb
///   .xyz .txt .csv  a point a line, cells separated by blanks, commas or semicolons;
///                   # and // start comments. A header line may name the columns
///                   (x, y, z, nx, ny, nz, r, g, b, …). Without one the first three columns are x y z, and
///                   six columns are x y z and a unit normal; other numbers of columns say nothing
///   .npy  N×3, or N×6 (positions, unit normals); little-endian f4 or f8, C order
///   .obj .off .stl  meshes; equal corners of an STL are one vertex
/// In all of them polygons become fans of triangles. Points with a coordinate that is not finite are holes, as cameras
/// and lidars mark what they did not see: they are left out and counted, but for the vertices of a mesh, which are
/// refused. Colours must be finite. Normals are scaled to unit length; a cloud whose normals are all zero has none, and
/// one that is zero or not finite among others is refused unless a Scan is asked for. Integer colours are scaled to [0, 1], floating-point ones too if any is above 1.
enum class CloudFormat { ply, pcd, text, npy, obj, off, stl };

/// `unsupported` when the extension is not one of the above.
Result<CloudFormat> cloud_format(const std::filesystem::path& path);

/// What a file holds: a cloud, or (when it has faces) a mesh.
struct Geometry {
  PointCloud cloud;                     ///< the points; for a mesh, its vertices
  Mesh mesh;                            ///< empty triangles when the file has no faces
  std::size_t holes = 0;                ///< points that were left out
  std::size_t bare = 0;                 ///< points without a normal, which is zero, where others have one
  std::optional<Vec3d> viewpoint = {};  ///< where the sensor stood, if the file says so (a PCD's VIEWPOINT)
  bool is_mesh() const { return !mesh.triangles.empty(); }
};

struct ReadOptions {
  bool strict = false;             ///< refuse holes: `bad_file` names the first one
  std::size_t mesh_points = 2048;  ///< points to sample when the file is a mesh
  std::uint64_t seed = 0;          ///< seed of that sampling
};

/// Parses bytes already in memory; `name` only labels errors. `bad_file` when they are malformed or have no point but
/// holes; `unsupported` for a variant not listed above.
Result<Geometry> parse_geometry(std::span<const std::byte> bytes, CloudFormat format, std::string_view name,
                                const ReadOptions& options = {});

/// Reads a whole file. `io` when it cannot be opened or read, else as parse_geometry.
Result<Geometry> read_geometry(const std::filesystem::path& path, const ReadOptions& options = {});

/// Reads a cloud; a mesh is sampled uniformly by area (see sample_mesh).
Result<PointCloud> read_cloud(const std::filesystem::path& path, const ReadOptions& options = {});

/// A cloud with what its file says besides, for solve(), which can do without some of the normals.
struct Scan {
  PointCloud cloud;                     ///< normals may be zero
  std::size_t holes = 0, bare = 0;      ///< see Geometry
  std::optional<Vec3d> viewpoint = {};  ///< see Geometry
};
/// As read_cloud, but a normal may be missing.
Result<Scan> read_scan(const std::filesystem::path& path, const ReadOptions& options = {});

/// `count` independent points, uniform by area over the mesh, with unit face normals. Same seed, same points;
/// a mesh moved rigidly gives the same points, moved. `invalid_argument` when the mesh has no area, a
/// triangle uses a vertex that is not there, or count is 0.
Result<PointCloud> sample_mesh(const Mesh& mesh, std::size_t count, std::uint64_t seed);

/// `count` distinct points drawn without replacement, in their original order; the cloud itself when it is
/// not larger. Same seed, same points.
PointCloud subsample(const CloudView& cloud, std::size_t count, std::uint64_t seed);

enum class PlyEncoding { ascii, binary_little_endian };

/// Writes positions (as float when all are exactly representable, else double), normals and colours (8 bit)
/// if present; positions and normals read back bit for bit. Written as write_file does. `invalid_argument`
/// for NaN or infinite values, and for normals or colours that are not one per point.
Result<void> write_ply(const std::filesystem::path& path, const PointCloud& cloud,
                       PlyEncoding encoding = PlyEncoding::binary_little_endian);

/// A file's content with its cloud or mesh moved by T: positions become R x + t, normals (of points, of an
/// OBJ, of facets and faces) R n, each in the type it has in the file (digits: the shortest that give the
/// value of that type back, a double where the file does not say). Every other byte is as it was: other
/// properties, fields and columns, colours, faces, comments, the header (a PCD's VIEWPOINT included); only
/// the block of a compressed PCD is packed anew. Errors as of parse_geometry; `unsupported` when positions
/// are of an integer type, `invalid_argument` when a moved value is beyond its type.
Result<std::vector<std::byte>> moved_geometry(std::span<const std::byte> bytes, CloudFormat format,
                                              std::string_view name, const Pose& T);

/// Writes `in`, moved by T, to `out`, as write_file does. `invalid_argument` when `out` has another
/// extension.
Result<void> move_cloud_file(const std::filesystem::path& in, const std::filesystem::path& out,
                             const Pose& T);
/// Whether move_cloud_file could do it, but for writing; T has no say in that unless it leads beyond a type.
Result<void> check_move(const std::filesystem::path& in, const std::filesystem::path& out);

/// Writes `bytes` atomically: a temporary file in the same folder, flushed, renamed over `path`. On failure
/// (`io`) the temporary is gone and an older file is as it was. An existing file keeps its permissions, a
/// symbolic link its target's place, and a link to nothing is refused; pipes and devices are written to
/// directly. Temporaries that killed processes left in the folder are removed.
Result<void> write_file(const std::filesystem::path& path, std::span<const std::byte> bytes);

/// Reads a whole file (or pipe) of up to 8 GiB into memory.
Result<std::vector<std::byte>> read_file(const std::filesystem::path& path);

}  // namespace bitr::io
