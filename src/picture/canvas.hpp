// One panel's clouds, drawn as balls with a depth buffer, at several samples a pixel.
#pragma once

#include <Eigen/Core>
#include <bitr/picture.hpp>
#include <cstdint>
#include <vector>

#include "picture/scene.hpp"

namespace bitr::picture {

struct Color {
  float r = 0, g = 0, b = 0;  ///< sRGB, 0 … 1
};
Color color_of(Role role);

class Canvas {
 public:
  static constexpr int samples = 3;  ///< along each side of a pixel

  Canvas(int width, int height);

  /// Every point of the part, in pixels from the canvas's left and top. Nearer points hide farther ones.
  void draw(const Scene& scene, const Panel& panel, const Part& part);

  /// The samples' mean over white, with outlines where depth jumps, paler with distance; into the image's
  /// columns from the panel's left, rows from the top.
  void resolve(Image& image, int left) const;

 private:
  struct Sample {
    float depth = -std::numeric_limits<float>::infinity();  ///< pixels towards the viewer
    float order = depth;                                    ///< what hides what: the depth, but for checks
    Role role = Role::source;
    std::uint8_t light = 0;
  };
  struct Stamp;

  Stamp make_stamp(float radius, bool has_normals) const;
  void put(const Eigen::Vector3f& at, const Stamp& stamp, float lift, Role role, float light);
  float shade(int x, int y) const;

  int width_, height_;  ///< in samples
  std::vector<Sample> samples_;
};

/// Radius in pixels at which balls of this spacing (pixels) close a surface, within what is still visible and
/// what still looks like points.
float splat_radius(float spacing, int picture_width);

}  // namespace bitr::picture
