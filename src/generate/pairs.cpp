#include "generate/pairs.hpp"

#include <algorithm>

#include "generate/break.hpp"
#include "generate/seeds.hpp"

namespace bitr::generate {
namespace {

void add_noise(PointCloud& cloud, const Separation& how, Random& random) {
  if (how.noise == 0) return;
  for (Vec3d& point : cloud.positions)
    for (double& coordinate : point)
      coordinate += how.noise * std::clamp(random.normal(), -how.clip, how.clip);
}

}  // namespace

Pose random_pose(double translation, Random& random) {
  Pose pose;
  pose.rotation = random.rotation();
  for (double& t : pose.translation) t = random.uniform(-translation, translation);
  return pose;
}

void move(PointCloud& cloud, const Pose& pose) {
  for (Vec3d& point : cloud.positions) point = pose.apply(point);
  for (Vec3f& normal : cloud.normals) {
    const Vec3d turned = pose.rotate({normal[0], normal[1], normal[2]});
    for (int axis = 0; axis < 3; ++axis) normal[axis] = static_cast<float>(turned[axis]);
  }
}

void separate(GeneratedPair& pair, const Separation& how, std::uint64_t seed) {
  Random poses = random_for(seed, Draw::poses), noise = random_for(seed, Draw::noise);
  const Pose T_source_object = random_pose(how.translation, poses);
  const Pose T_reference_object = random_pose(how.translation, poses);
  for (PointCloud* cloud : {&pair.source, &pair.reference}) {
    if (!how.normals) cloud->normals.clear();
    add_noise(*cloud, how, noise);
  }
  move(pair.source, T_source_object);
  move(pair.reference, T_reference_object);
  pair.T_source_object = T_source_object;
  pair.T_reference_source = T_reference_object * T_source_object.inverse();
}

GeneratedPair sample_twice(const Shape& shape, std::size_t count, bool same_points, std::uint64_t seed) {
  Random random = random_for(seed, Draw::points);
  GeneratedPair pair;
  pair.source = sample(shape, count, random);
  pair.reference = same_points ? pair.source : sample(shape, count, random);
  pair.overlap = 1;
  pair.symmetry = shape.symmetry();
  return pair;
}

Result<GeneratedPair> sample_and_crop(const Shape& shape, std::size_t count, bool same_points,
                                      const CropOptions& options) {
  const GeneratedPair whole = sample_twice(shape, count, same_points, options.seed);
  auto pair =
      same_points ? crop_pair(whole.source, options) : crop_pair(whole.source, whole.reference, options);
  if (pair) pair->symmetry = whole.symmetry;
  return pair;
}

GeneratedPair break_in_two(const Shape& shape, std::size_t count, double roughness, std::uint64_t seed) {
  Random cut = random_for(seed, Draw::cut), random = random_for(seed, Draw::points);
  Break crack(roughness, cut);
  crack.divide(sample(shape, 500, cut), cut.uniform(0.4, 0.6));
  GeneratedPair pair;
  pair.symmetry = shape.symmetry();
  auto [below, above] = sample_fragments(shape, crack, count, random);
  pair.source = std::move(below);
  pair.reference = std::move(above);
  return pair;
}

}  // namespace bitr::generate
