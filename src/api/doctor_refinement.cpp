// Refinement's kernels: from the same start to the same pose as on the CPU, in double precision but for the
// sums.
#include <algorithm>
#include <bitr/refine.hpp>
#include <cmath>

#include "api/doctor.hpp"
#include "core/failure.hpp"
#include "core/guarded.hpp"
#include "core/random.hpp"

namespace bitr {
namespace {

constexpr double refined_degrees = 1e-2;
constexpr double refined_translation = 1e-4;  // over the clouds' size

// Two samples of one surface, and a start a little off the motion between them.
struct Pairs {
  std::vector<PointCloud> sources, references;
  std::vector<Pose> starts;

  void add(Random& random, std::size_t source_points, std::size_t reference_points, bool normals) {
    const Pose truth{random.rotation(),
                     {random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)}};
    sources.push_back(sample(random, source_points, {}, normals));
    references.push_back(sample(random, reference_points, truth, normals));
    const double c = std::cos(0.05), s = std::sin(0.05);
    starts.push_back(truth * Pose{{c, -s, 0, s, c, 0, 0, 0, 1}, {0.01, -0.02, 0.015}});
  }
  std::vector<CloudPair> views() const {
    std::vector<CloudPair> all;
    for (std::size_t i = 0; i < sources.size(); ++i) all.push_back({sources[i], references[i]});
    return all;
  }

 private:
  // A saddle that is bent unevenly.
  static PointCloud sample(Random& random, std::size_t points, const Pose& pose, bool normals) {
    PointCloud cloud;
    for (std::size_t i = 0; i < points; ++i) {
      const double u = random.uniform(-1, 1), v = random.uniform(-1, 1);
      const Vec3d normal = pose.rotate({-(1.2 * u + 0.3 * v), 0.8 * v - 0.3 * u + 0.6 * v * v, 1});
      const double length = std::hypot(normal[0], normal[1], normal[2]);
      cloud.positions.push_back(
          pose.apply({u, v, 0.6 * u * u - 0.4 * v * v + 0.3 * u * v - 0.2 * v * v * v}));
      if (normals)
        cloud.normals.push_back({static_cast<float>(normal[0] / length),
                                 static_cast<float>(normal[1] / length),
                                 static_cast<float>(normal[2] / length)});
    }
    return cloud;
  }
};

void compare(const Device& device, const std::string& what, const Pairs& pairs, const RefineOptions& options,
             std::vector<Check>& checks) {
  Check rotation{what + ", rotation in degrees", 0, refined_degrees, ""},
      translation{what + ", translation over the clouds' size", 0, refined_translation, ""};
  try {
    const std::vector<CloudPair> views = pairs.views();
    const auto found = value_or_throw(refine_poses(device, views, pairs.starts, options));
    const auto expected =
        value_or_throw(refine_poses(cpu_device(device.threads()), views, pairs.starts, options));
    constexpr double cloud_size = 2;
    for (std::size_t i = 0; i < found.size(); ++i) {
      const double degrees = rotation_error_degrees(found[i].proposal, expected[i].proposal);
      const double shift = translation_error(found[i].proposal, expected[i].proposal) / cloud_size;
      // A NaN stays.
      if (!(degrees <= rotation.measured)) rotation.measured = degrees;
      if (!(shift <= translation.measured)) translation.measured = shift;
    }
  } catch (const Failure& failure) {
    if (failure.error().code == ErrorCode::device_lost) throw;
    rotation.problem = translation.problem = failure.what();
  }
  checks.push_back(rotation);
  checks.push_back(translation);
}

}  // namespace

void check_refinement(const Device& device, std::vector<Check>& checks) {
  if (device.backend() != Backend::vulkan) return;
  Random random(23);
  Pairs clouds, small;
  for (const auto& [n, m, normals] : {std::tuple{33, 70, false}, {512, 512, true}, {5000, 4000, false}})
    clouds.add(random, n, m, normals);
  for (const auto& [n, m, normals] : {std::tuple{33, 70, false}, {512, 512, true}, {300, 257, false}})
    small.add(random, n, m, normals);
  compare(device, "refinement by nearest points", clouds, {.least_overlap = 0, .most_iterations = 10},
          checks);
  compare(device, "refinement by transport", small,
          {.method = RefineMethod::transport, .least_overlap = 0, .most_iterations = 3}, checks);
}

}  // namespace bitr
