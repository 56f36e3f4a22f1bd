#include "picture/canvas.hpp"

#include <algorithm>
#include <cmath>

namespace bitr::picture {
namespace {

using Eigen::Vector3f;

const Vector3f to_light = Vector3f(-0.45F, 0.6F, 0.66F).normalized();
constexpr float ambient = 0.5F, diffuse = 0.5F;  // together 1: what faces the light has the cloud's colour

float lambert(const Vector3f& normal) { return std::max(0.0F, normal.dot(to_light)); }

// Whether normals point outwards is not known: the side that is seen is lit.
float light_of(const Vector3f& normal) {
  return ambient + diffuse * lambert(normal[2] < 0 ? Vector3f(-normal) : normal);
}

// Surfaces that coincide show in turn, in squares: mixed point by point they would be one grey.
float check(const Vector3f& at, int letter) {
  const float square = 4.0F * static_cast<float>(letter), lift = 0.75F * static_cast<float>(letter);
  const int parity =
      static_cast<int>(std::floor(at[0] / square)) + static_cast<int>(std::floor(at[1] / square));
  return parity % 2 == 0 ? lift : -lift;
}

std::uint8_t eight_bit(float value) {
  return static_cast<std::uint8_t>(255 * std::clamp(value, 0.0F, 1.0F) + 0.5F);
}

}  // namespace

Color color_of(Role role) {
  return role == Role::source ? Color{0.95F, 0.50F, 0.08F} : Color{0.16F, 0.45F, 0.82F};
}

float splat_radius(float spacing, int picture_width) {
  const float largest = 6.2F * static_cast<float>(picture_width) / 1920;
  return std::clamp(1.5F * spacing, 0.85F, std::max(largest, 1.0F));
}

Canvas::Canvas(int width, int height)
    : width_(width * samples),
      height_(height * samples),
      samples_(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_)) {}

// A ball's silhouette and relief, made once for all points of a cloud.
struct Canvas::Stamp {
  struct Dot {
    std::ptrdiff_t offset = 0;  ///< from the centre's sample to this one
    float depth = 0;            ///< pixels towards the viewer, 0 at the rim
    float light = 0;            ///< added to the point's own
  };
  std::vector<Dot> dots;
  int reach = 0;  ///< samples from the centre to the edge
};

Canvas::Stamp Canvas::make_stamp(float radius, bool has_normals) const {
  Stamp stamp;
  // The relief of balls shows once they are a few pixels wide, and less where normals give the shape.
  const float relief = std::clamp((radius - 1) / 2, 0.0F, 1.0F) * (has_normals ? 0.5F : 1.0F);
  const int reach = static_cast<int>(std::ceil(radius * samples));
  stamp.reach = reach;
  for (int y = -reach; y <= reach; ++y) {
    for (int x = -reach; x <= reach; ++x) {
      const float across = static_cast<float>(x) / (radius * samples),
                  up = -static_cast<float>(y) / (radius * samples);
      const float squared = across * across + up * up;
      if (squared > 1) continue;
      const float towards = std::sqrt(1 - squared);
      const float light = diffuse * (lambert({across, up, towards}) - lambert({0, 0, 1}));
      stamp.dots.push_back(
          {.offset = std::ptrdiff_t{y} * width_ + x, .depth = radius * towards, .light = relief * light});
    }
  }
  return stamp;
}

void Canvas::draw(const Scene& scene, const Panel& panel, const Part& part) {
  const SeenCloud& cloud = *part.cloud;
  const bool has_normals = !cloud.normals.empty(),
             checked = part.role == Role::source && panel.parts.size() > 1;
  const Stamp stamp = make_stamp(
      splat_radius(cloud.spacing * static_cast<float>(scene.scale), scene.picture_width), has_normals);
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    Vector3f at = scene.project(panel, cloud.points[i] + part.offset);
    at[0] -= static_cast<float>(panel.left);
    put(at, stamp, checked ? check(at, scene.letter) : 0, part.role,
        light_of(has_normals ? cloud.normals[i] : Vector3f(0, 0, 1)));
  }
}

// The panel's margin is wider than any ball.
void Canvas::put(const Vector3f& at, const Stamp& stamp, float lift, Role role, float light) {
  const int x = static_cast<int>(std::floor(at[0] * samples)),
            y = static_cast<int>(std::floor(at[1] * samples));
  if (x < stamp.reach || x >= width_ - stamp.reach || y < stamp.reach || y >= height_ - stamp.reach) return;
  Sample* const centre = &samples_[static_cast<std::size_t>(y) * width_ + x];
  for (const Stamp::Dot& dot : stamp.dots) {
    Sample& sample = centre[dot.offset];
    const float depth = at[2] + dot.depth;
    if (depth + lift > sample.order)
      sample = {.depth = depth, .order = depth + lift, .role = role, .light = eight_bit(light + dot.light)};
  }
}

// Darker where samples around are nearer (Boucheny's eye-dome lighting): edges and hollows show without
// normals.
float Canvas::shade(int x, int y) const {
  static constexpr int ring[8][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {1, -1}, {-1, 1}, {-1, -1}};
  const float depth = samples_[static_cast<std::size_t>(y) * width_ + x].depth;
  float hidden = 0;
  for (const int reach : {samples, 4 * samples}) {
    for (const auto& [dx, dy] : ring) {
      const int column = x + reach * dx, row = y + reach * dy;
      if (column < 0 || column >= width_ || row < 0 || row >= height_) continue;
      const float nearer = samples_[static_cast<std::size_t>(row) * width_ + column].depth - depth;
      // What lies within the slope of a surface hides nothing.
      const float step = static_cast<float>(reach) / samples;
      if (nearer > step) hidden += std::min(nearer / step - 1, 8.0F);
    }
  }
  return std::exp(-0.02F * hidden);
}

void Canvas::resolve(Image& image, int left) const {
  float nearest = -std::numeric_limits<float>::infinity(), farthest = -nearest;
  for (const Sample& sample : samples_) {
    if (!std::isfinite(sample.depth)) continue;
    nearest = std::max(nearest, sample.depth);
    farthest = std::min(farthest, sample.depth);
  }
  const float range = std::max(nearest - farthest, 1.0F);

  for (int row = 0; row < height_ / samples; ++row) {
    for (int column = 0; column < width_ / samples; ++column) {
      float r = 0, g = 0, b = 0;
      for (int i = 0; i < samples * samples; ++i) {
        const int x = column * samples + i % samples, y = row * samples + i / samples;
        const Sample& sample = samples_[static_cast<std::size_t>(y) * width_ + x];
        if (!std::isfinite(sample.depth)) {
          r += 1, g += 1, b += 1;
          continue;
        }
        const Color color = color_of(sample.role);
        const float light = static_cast<float>(sample.light) / 255 * shade(x, y);
        const float pale = 0.45F * (nearest - sample.depth) / range;
        r += light * (color.r + pale * (1 - color.r));
        g += light * (color.g + pale * (1 - color.g));
        b += light * (color.b + pale * (1 - color.b));
      }
      std::uint8_t* pixel = &image.rgb[3 * (static_cast<std::size_t>(row) * image.width + left + column)];
      constexpr float mean = 1.0F / (samples * samples);
      pixel[0] = eight_bit(r * mean);
      pixel[1] = eight_bit(g * mean);
      pixel[2] = eight_bit(b * mean);
    }
  }
}

}  // namespace bitr::picture
