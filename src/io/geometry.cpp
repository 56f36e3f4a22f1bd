// From a path to points: which parser, and what becomes of a mesh.
#include <algorithm>
#include <new>
#include <stdexcept>
#include <string>

#include "io/complaint.hpp"
#include "io/formats.hpp"

namespace bitr::io {

std::string extension_of(const std::filesystem::path& path) {
  std::string extension = path.extension().native();
  for (char& c : extension)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return extension;
}

Result<CloudFormat> cloud_format(const std::filesystem::path& path) {
  static constexpr struct {
    std::string_view extension;
    CloudFormat format;
  } formats[] = {{".ply", CloudFormat::ply},  {".pcd", CloudFormat::pcd},  {".xyz", CloudFormat::text},
                 {".txt", CloudFormat::text}, {".csv", CloudFormat::text}, {".npy", CloudFormat::npy},
                 {".obj", CloudFormat::obj},  {".off", CloudFormat::off},  {".stl", CloudFormat::stl}};
  const std::string extension = extension_of(path);
  for (const auto& [known, format] : formats) {
    if (extension == known) return format;
  }
  return fail(ErrorCode::unsupported, text(label(path.native()), ": extension ", in_quotes(extension),
                                           " is not one of .ply .pcd .xyz .txt .csv .npy .obj .off .stl"));
}

Result<Geometry> parse_file(const File& file, CloudFormat format) {
  if (file.bytes.empty()) return refuse(ErrorCode::bad_file, file, "the file is empty");
  switch (format) {
    case CloudFormat::ply:
      return parse_ply(file);
    case CloudFormat::pcd:
      return parse_pcd(file);
    case CloudFormat::text:
      return parse_text(file);
    case CloudFormat::npy:
      return parse_npy(file);
    case CloudFormat::obj:
      return parse_obj(file);
    case CloudFormat::off:
      return parse_off(file);
    case CloudFormat::stl:
      return parse_stl(file);
  }
  return refuse(ErrorCode::unsupported, file, "format ", static_cast<int>(format), " is none of CloudFormat");
}

namespace {

Result<Geometry> parse_within_memory(const File& file, CloudFormat format) try {
  return parse_file(file, format);
} catch (const std::bad_alloc&) {
  return fail(ErrorCode::io, text(label(file.name), ": too large for this machine's memory"));
} catch (const std::length_error&) {
  return fail(ErrorCode::io, text(label(file.name), ": too large for this machine's memory"));
}

Result<Geometry> read(const std::filesystem::path& path, const ReadOptions& options, bool bare_points) {
  const auto format = cloud_format(path);
  if (!format) return tl::unexpected(format.error());
  const auto bytes = read_file(path);
  if (!bytes) return tl::unexpected(bytes.error());
  return parse_within_memory(
      {.bytes = *bytes, .name = path.native(), .strict = options.strict, .bare_points = bare_points},
      *format);
}

Result<Scan> scan_of(Geometry geometry, const std::filesystem::path& path, const ReadOptions& options) {
  Scan scan;
  scan.holes = geometry.holes;
  scan.bare = geometry.bare;
  scan.viewpoint = geometry.viewpoint;
  if (!geometry.is_mesh()) {
    scan.cloud = std::move(geometry.cloud);
    return scan;
  }
  auto cloud = sample_mesh(geometry.mesh, options.mesh_points, options.seed);
  if (!cloud) return fail(cloud.error().code, text(label(path.native()), ": ", cloud.error().message));
  scan.cloud = std::move(*cloud);
  scan.bare = 0;
  return scan;
}

}  // namespace

Result<Geometry> parse_geometry(std::span<const std::byte> bytes, CloudFormat format, std::string_view name,
                                const ReadOptions& options) {
  return parse_within_memory({.bytes = bytes, .name = name, .strict = options.strict}, format);
}

Result<Geometry> read_geometry(const std::filesystem::path& path, const ReadOptions& options) {
  return read(path, options, false);
}

Result<Scan> read_scan(const std::filesystem::path& path, const ReadOptions& options) {
  auto geometry = read(path, options, true);
  if (!geometry) return tl::unexpected(geometry.error());
  return scan_of(std::move(*geometry), path, options);
}

Result<PointCloud> read_cloud(const std::filesystem::path& path, const ReadOptions& options) {
  auto geometry = read(path, options, false);
  if (!geometry) return tl::unexpected(geometry.error());
  auto scan = scan_of(std::move(*geometry), path, options);
  if (!scan) return tl::unexpected(scan.error());
  return std::move(scan->cloud);
}

Result<std::vector<std::byte>> ply_file(const std::filesystem::path& path, const PointCloud& cloud,
                                        PlyEncoding encoding) try {
  auto bytes = serialize_ply(cloud, encoding);
  if (!bytes) bytes.error().message = text(label(path.native()), ": ", bytes.error().message);
  return bytes;
} catch (const std::bad_alloc&) {
  return fail(ErrorCode::io,
              text(label(path.native()), ": ", cloud.size(), " points are too many for memory"));
}

Result<void> write_ply(const std::filesystem::path& path, const PointCloud& cloud, PlyEncoding encoding) {
  const auto bytes = ply_file(path, cloud, encoding);
  return bytes ? write_file(path, *bytes) : tl::unexpected(bytes.error());
}

}  // namespace bitr::io
