// What a picture shows, before anything is drawn: clouds as the camera sees them, arranged in four panels.
#pragma once

#include <Eigen/Core>
#include <array>
#include <bitr/picture.hpp>
#include <cstdint>
#include <string>
#include <vector>

#include "picture/box.hpp"

namespace bitr::picture {

enum class Role : std::uint8_t { source, reference };

/// Seen by the camera: x to the right, y up, z towards the viewer, around the centre of the cloud's box, in
/// units of the scene's length.
struct SeenCloud {
  std::vector<Eigen::Vector3f> points, normals, key_points;
  float spacing = 0;  ///< mean distance of neighbours on the surface
};

/// A cloud in a panel, its centre at `offset`.
struct Part {
  Role role = Role::source;
  const SeenCloud* cloud = nullptr;
  Eigen::Vector3f offset = Eigen::Vector3f::Zero();
};

struct Panel {
  std::string title, note;
  std::vector<Part> parts;
  Box box = {};                 ///< around the parts, in the scene's units
  int left = 0, width = 0;      ///< pixels; the panel has the picture's height above the captions
  Eigen::Vector2d middle = {};  ///< pixels from the picture's left and top: where the box's centre is seen
};

/// Not to be moved: panels point to the clouds.
struct Scene {
  Scene(const PointCloud& source, const PointCloud& reference, const Assembly& assembly,
        const PictureOptions& options);
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  /// Pixels from the picture's left and top, and towards the viewer, of a point in a panel's scene units.
  Eigen::Vector3f project(const Panel& panel, const Eigen::Vector3f& point) const;

  int picture_width = 0;
  double length = 1;  ///< one of the scene's units, in the clouds' units
  double scale = 1;   ///< pixels per scene unit, the same in every panel
  int letter = 1;     ///< pixels per dot of the captions' letters
  int caption_height = 0;
  SeenCloud source, assembled, reference;
  std::array<Panel, 4> panels;  ///< source, reference, before, after

 private:
  void arrange(const PictureOptions& options);
};

}  // namespace bitr::picture
