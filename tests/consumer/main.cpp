// What a user's first program does: two clouds in memory, one pose.
#include <bitr/bitr.hpp>
#include <cmath>
#include <cstdio>
#include <vector>

int main() {
  const bitr::Pose truth = {{0, -1, 0, 1, 0, 0, 0, 0, 1}, {1, 2, 3}};
  bitr::PointCloud source, reference;
  for (int i = 0; i < 60; ++i) {
    const bitr::Vec3d point = {std::sin(1.7 * i), std::cos(2.3 * i) * 0.6,
                               0.01 * i + 0.2 * std::sin(0.9 * i * i)};
    source.positions.push_back(point);
    reference.positions.push_back(truth.apply(point));
  }

  const auto model = bitr::untrained_model();
  if (!model) return std::fprintf(stderr, "%s\n", model.error().message.c_str()), 1;
  const std::vector<bitr::CloudPair> pairs = {{source, reference}};
  const bitr::AssembleOptions options = {.complete_match = true};
  auto plan = bitr::make_plan(bitr::cpu_device(1), *model, bitr::shape_of(pairs));
  if (!plan) return std::fprintf(stderr, "%s\n", plan.error().message.c_str()), 1;
  const auto assemblies = bitr::assemble(*plan, pairs, options);
  if (!assemblies) return std::fprintf(stderr, "%s\n", assemblies.error().message.c_str()), 1;

  const double error = bitr::rotation_error_degrees(assemblies->front().T_reference_source, truth);
  std::printf("rotation error %g degrees\n", error);
  return error < 0.1 ? 0 : 1;
}
