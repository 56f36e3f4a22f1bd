// A picture of an assembly, for a person to look at: the source, the reference, both as given, both
// assembled.
#pragma once

#include <array>
#include <bitr/assemble.hpp>
#include <bitr/cloud.hpp>
#include <bitr/result.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

namespace bitr {

/// sRGB, 8 bits a channel: rows from the top, pixels from the left, red, green, blue.
struct Image {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;  ///< width · height · 3
};

struct PictureOptions {
  int width = 1920, height = 520;         ///< the whole picture, in pixels: 640 … 16384 and 240 … 16384
  bool key_points = true;                 ///< mark those that the assembly has with rings, and say so
  std::optional<double> confidence = {};  ///< written below the assembled clouds, 0 … 1
  /// The camera, the same in every panel: rows are its right, its up and the direction towards the viewer, an
  /// orthonormal right-handed frame. Not given: the reference from its flat side, its longest axis across,
  /// turned to a three-quarter view, so the picture does not depend on the reference's pose.
  std::optional<std::array<double, 9>> view = {};
};

/// Four panels of one scale, without perspective: the source, in its frame; the reference, in its frame; both
/// as given, each at the coordinates it has; both assembled, in the reference's frame. The source is orange,
/// the reference blue, lighter with distance; points are as large as their density asks for and lit by their
/// normals if they have any. Clouds too far apart to share a panel are drawn closer together, and the caption
/// says so. Same input, same picture.
///
/// `invalid_argument` when a cloud is empty, has normals that are not one per point or a coordinate that is
/// not finite or beyond 1e100, the pose is not finite, a size is out of its range, or the view is no
/// rotation.
Result<Image> render_picture(const PointCloud& source, const PointCloud& reference, const Assembly& assembly,
                             const PictureOptions& options = {});

/// The image as a PNG file's bytes. `invalid_argument` when its size and its number of bytes do not agree.
Result<std::vector<std::byte>> encode_png(const Image& image);

/// render_picture, encode_png, io::write_file: the file appears whole or not at all.
Result<void> write_picture(const std::filesystem::path& path, const PointCloud& source,
                           const PointCloud& reference, const Assembly& assembly,
                           const PictureOptions& options = {});

}  // namespace bitr
