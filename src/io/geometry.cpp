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

Result<Geometry> parse_geometry(std::span<const std::byte> bytes, CloudFormat format,
                                std::string_view name) try {
  return parse_file({bytes, name}, format);
} catch (const std::bad_alloc&) {
  return fail(ErrorCode::io, text(label(name), ": too large for this machine's memory"));
} catch (const std::length_error&) {
  return fail(ErrorCode::io, text(label(name), ": too large for this machine's memory"));
}

Result<Geometry> read_geometry(const std::filesystem::path& path) {
  const auto format = cloud_format(path);
  if (!format) return tl::unexpected(format.error());
  const auto bytes = read_file(path);
  if (!bytes) return tl::unexpected(bytes.error());
  return parse_geometry(*bytes, *format, path.native());
}

Result<PointCloud> read_cloud(const std::filesystem::path& path, const ReadOptions& options) {
  auto geometry = read_geometry(path);
  if (!geometry) return tl::unexpected(geometry.error());
  if (!geometry->is_mesh()) return std::move(geometry->cloud);
  auto cloud = sample_mesh(geometry->mesh, options.mesh_points, options.seed);
  if (!cloud) cloud.error().message = text(label(path.native()), ": ", cloud.error().message);
  return cloud;
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
