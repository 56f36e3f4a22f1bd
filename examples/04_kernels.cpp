// The kernels without the network: neighbours of points, products of features along the edges to them, and
// attention over them; the same calls on the CPU and on the best GPU there is.
#include <algorithm>
#include <bitr/kernels.hpp>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <vector>

namespace {

// The value, or the end of the program with the reason.
template <class T>
T must(bitr::Result<T> result) {
  if (result) return *std::move(result);
  std::fprintf(stderr, "%s\n", result.error().message.c_str());
  std::exit(1);
}

// What point 0 sees: its nearest neighbours, the moment of their directions, and what it attends to.
std::vector<float> look_around(const bitr::Device& device) {
  constexpr std::uint32_t n = 400;
  constexpr int k = 8;
  std::vector<float> points;  // two clouds of a batch on a bent curve, in the order (y, z, x) of degree 1
  for (std::uint32_t i = 0; i < n; ++i) {
    const auto s = static_cast<float>(i);
    points.insert(points.end(), {std::sin(1.7F * s), 0.6F * std::cos(2.3F * s), 0.4F * std::sin(0.9F * s)});
  }
  const std::vector<std::uint32_t> clouds = {0, 150, n};

  const auto index = must(bitr::knn(device, {.k = k, .dim = 3}, {points, clouds}));

  // Products along edges: features of the neighbour (here, its position) with something of the edge's own
  // (here, its direction). The part of degree 1 is their cross product over √2.
  std::vector<float> directions;
  for (std::uint32_t e = 0; e < n * k; ++e)
    for (std::uint32_t a = 0; a < 3; ++a)
      directions.push_back(points[3 * (e / k) + a] - points[3 * index[e] + a]);
  const bitr::CgProductShape cross{.a = {1}, .b = {1}, .out = {1}, .k = k};
  const auto moments = must(bitr::cg_product(device, cross, {points, directions, index}));

  // Every point attends to neighbours that lie in its own direction.
  const bitr::AttentionShape shape{.key_width = 3, .value_width = 3, .k = k, .scale = 1 / std::sqrt(3.0)};
  const auto seen = must(bitr::attention(device, shape, {points, points, points, index}));

  std::printf("%s\n  neighbours", device.name().c_str());
  for (int j = 0; j < k; ++j) std::printf(" %u", index[j]);
  std::printf("\n  moment of the nearest %.5f %.5f %.5f\n  attended to %.5f %.5f %.5f\n", moments[0],
              moments[1], moments[2], seen[0], seen[1], seen[2]);
  return seen;
}

}  // namespace

int main() {
  const auto expected = look_around(bitr::cpu_device());
  const auto gpu = bitr::create_device();
  if (!gpu) return std::printf("no Vulkan: %s\n", gpu.error().message.c_str()), 0;
  const auto seen = look_around(*gpu);
  float worst = 0;
  for (std::size_t i = 0; i < seen.size(); ++i) worst = std::max(worst, std::abs(seen[i] - expected[i]));
  std::printf("largest difference %g\n", worst);
  return worst < 1e-5F ? 0 : 1;
}
