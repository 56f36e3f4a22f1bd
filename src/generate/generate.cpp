#include <array>
#include <bitr/generate.hpp>
#include <cmath>
#include <iterator>
#include <string>

#include "generate/kinds.hpp"

namespace bitr {
namespace {

using Make = generate::Assembled (*)(const GenerateOptions&, Random&);

constexpr GeneratedKind kinds[] = {
    {"fragments", "a solid without symmetry, broken in two along a rough, curved surface"},
    {"copy", "a solid without symmetry, and a moved copy of exactly the same points"},
};
constexpr Make makers[] = {generate::fragments, generate::copy};
static_assert(std::size(kinds) == std::size(makers));

Result<Make> maker(std::string_view kind) {
  std::string known;
  for (std::size_t i = 0; i < std::size(kinds); ++i) {
    if (kinds[i].name == kind) return makers[i];
    known.append(known.empty() ? "" : ", ").append(kinds[i].name);
  }
  return fail(ErrorCode::invalid_argument, "unknown kind \"" + std::string(kind) + "\"; known: " + known);
}

Result<void> validate(const GenerateOptions& options) {
  if (options.points < 1 || options.points > max_generated_points)
    return fail(ErrorCode::invalid_argument, "points is " + std::to_string(options.points) + ", not in 1 … " +
                                                 std::to_string(max_generated_points));
  if (!(options.noise >= 0 && options.noise <= 1))
    return fail(ErrorCode::invalid_argument, "noise is " + std::to_string(options.noise) + ", not in 0 … 1");
  if (!(options.roughness >= 0 && options.roughness <= 0.1))
    return fail(ErrorCode::invalid_argument,
                "roughness is " + std::to_string(options.roughness) + ", not in 0 … 0.1");
  return {};
}

Pose random_pose(Random& random) {
  Pose pose;
  pose.rotation = random.rotation();
  for (double& t : pose.translation) t = random.uniform(-1, 1);
  return pose;
}

void add_noise(PointCloud& cloud, double deviation, Random& random) {
  if (deviation == 0) return;
  for (Vec3d& point : cloud.positions)
    for (double& coordinate : point) coordinate += deviation * random.normal();
}

void move(PointCloud& cloud, const Pose& pose) {
  for (Vec3d& point : cloud.positions) point = pose.apply(point);
  for (Vec3f& normal : cloud.normals) {
    const Vec3d turned = pose.rotate({normal[0], normal[1], normal[2]});
    for (int axis = 0; axis < 3; ++axis) normal[axis] = static_cast<float>(turned[axis]);
  }
}

}  // namespace

std::span<const GeneratedKind> generated_kinds() { return kinds; }

Result<GeneratedPair> generate_pair(std::string_view kind, const GenerateOptions& options) {
  const auto make = maker(kind);
  if (!make) return tl::unexpected(make.error());
  if (const auto valid = validate(options); !valid) return tl::unexpected(valid.error());

  // The poses come first, so that they do not depend on how many numbers the shape takes.
  Random random(options.seed);
  const Pose T_source_assembled = random_pose(random);
  const Pose T_reference_assembled = random_pose(random);
  auto [source, reference] = (*make)(options, random);
  add_noise(source, options.noise, random);
  add_noise(reference, options.noise, random);
  move(source, T_source_assembled);
  move(reference, T_reference_assembled);
  return GeneratedPair{std::move(source), std::move(reference),
                       T_reference_assembled * T_source_assembled.inverse()};
}

}  // namespace bitr
