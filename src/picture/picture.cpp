#include <bitr/io.hpp>
#include <bitr/picture.hpp>
#include <cmath>
#include <string>

#include "core/failure.hpp"
#include "core/guarded.hpp"
#include "picture/canvas.hpp"
#include "picture/captions.hpp"
#include "picture/checks.hpp"
#include "picture/scene.hpp"

namespace bitr {
namespace {

using namespace picture;

constexpr Color white = {1, 1, 1}, black = {0.13F, 0.13F, 0.15F}, grey = {0.45F, 0.45F, 0.48F};

void check(const PictureOptions& options) {
  if (options.width < 640 || options.width > 16384)
    refuse("a picture's width of " + std::to_string(options.width) + " pixels is not in 640 ... 16384");
  if (options.height < 240 || options.height > 16384)
    refuse("a picture's height of " + std::to_string(options.height) + " pixels is not in 240 ... 16384");
  if (!options.view) return;
  const Eigen::Map<const Eigen::Matrix3d> view(options.view->data());
  if (!((view * view.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < 1e-6) ||
      !(view.determinant() > 0))
    refuse("a picture's view is no rotation");
}

Color darker(const Color& color, float by) { return {color.r * by, color.g * by, color.b * by}; }

// Over everything: key points lie inside the shape. The source's are smaller, so both show where they meet.
void mark_key_points(Image& image, const Scene& scene, const Panel& panel) {
  const auto size = static_cast<float>(scene.letter);
  for (const Role role : {Role::reference, Role::source}) {
    for (const Part& part : panel.parts) {
      if (part.role != role) continue;
      for (const Eigen::Vector3f& point : part.cloud->key_points) {
        const Eigen::Vector3f at = scene.project(panel, point + part.offset);
        draw_mark(image, at[0], at[1], (role == Role::source ? 1.5F : 2.5F) * size, 0.7F * size,
                  darker(color_of(role), 0.62F), white);
      }
    }
  }
}

void write_captions(Image& image, const Scene& scene, const Panel& panel) {
  const int top = image.height - scene.caption_height;
  const auto centred = [&](const std::string& text, int line, const Color& color) {
    const int left = static_cast<int>(std::lround(panel.middle[0])) - text_width(text) * scene.letter / 2;
    draw_text(image, text, left, top + line * scene.letter, scene.letter, color);
  };
  centred(panel.title, 2, panel.parts.size() > 1 ? black : darker(color_of(panel.parts[0].role), 0.85F));
  centred(panel.note, 15, grey);
}

}  // namespace

Result<Image> render_picture(const PointCloud& source, const PointCloud& reference, const Assembly& assembly,
                             const PictureOptions& options) {
  return guarded([&]() -> Result<Image> {
    check(source, "source");
    check(reference, "reference");
    check(assembly);
    check(options);
    const Scene scene(source, reference, assembly, options);
    Image image = {.width = options.width, .height = options.height, .rgb = {}};
    image.rgb.assign(std::size_t{3} * static_cast<std::size_t>(image.width) * image.height, 255);
    for (const Panel& panel : scene.panels) {
      Canvas canvas(panel.width, options.height - scene.caption_height);
      for (const Part& part : panel.parts) canvas.draw(scene, panel, part);
      canvas.resolve(image, panel.left);
      mark_key_points(image, scene, panel);
      write_captions(image, scene, panel);
    }
    return image;
  });
}

Result<void> write_picture(const std::filesystem::path& path, const PointCloud& source,
                           const PointCloud& reference, const Assembly& assembly,
                           const PictureOptions& options) {
  const auto image = render_picture(source, reference, assembly, options);
  if (!image) return tl::unexpected(image.error());
  const auto bytes = encode_png(*image);
  if (!bytes) return tl::unexpected(bytes.error());
  return io::write_file(path, *bytes);
}

}  // namespace bitr
