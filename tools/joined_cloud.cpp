#include "joined_cloud.hpp"

#include <algorithm>
#include <bitr/picture.hpp>

namespace bitr::tool {

namespace {

bool has_normals(const PointCloud& cloud) {
  return !cloud.normals.empty() && std::ranges::find(cloud.normals, Vec3f{}) == cloud.normals.end();
}

}  // namespace

PointCloud joined_cloud(const PointCloud& source, const PointCloud& reference,
                        const Pose& T_reference_source) {
  constexpr Vec3f orange = {0.90F, 0.48F, 0.10F}, blue = {0.13F, 0.40F, 0.75F};
  PointCloud joined;
  for (const Vec3d& point : source.positions) joined.positions.push_back(T_reference_source.apply(point));
  joined.positions.insert(joined.positions.end(), reference.positions.begin(), reference.positions.end());

  if (has_normals(source) && has_normals(reference)) {
    for (const Vec3f& normal : source.normals) {
      const Vec3d turned = T_reference_source.rotate({normal[0], normal[1], normal[2]});
      joined.normals.push_back(
          {static_cast<float>(turned[0]), static_cast<float>(turned[1]), static_cast<float>(turned[2])});
    }
    joined.normals.insert(joined.normals.end(), reference.normals.begin(), reference.normals.end());
  }

  if (!source.colors.empty() && !reference.colors.empty()) {
    joined.colors = source.colors;
    joined.colors.insert(joined.colors.end(), reference.colors.begin(), reference.colors.end());
  } else {
    joined.colors.assign(source.size(), orange);
    joined.colors.resize(joined.size(), blue);
  }
  return joined;
}

Result<Bytes> picture_of(const PointCloud& source, const PointCloud& reference, const Assembly& assembly,
                         std::optional<double> confidence) {
  const auto image = render_picture(source, reference, assembly, {.confidence = confidence});
  return image ? encode_png(*image) : tl::unexpected(image.error());
}

}  // namespace bitr::tool
