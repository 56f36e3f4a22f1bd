#include "core/spacing.hpp"

#include <algorithm>
#include <cmath>

namespace bitr {

double median_spacing(const PointTree& tree, const std::vector<Vec3d>& points) {
  constexpr std::size_t samples = 2000, looked_at = 8;
  const std::size_t step = std::max<std::size_t>(1, points.size() / samples);
  std::vector<double> nearest;
  for (std::size_t i = 0; i < points.size(); i += step) {
    std::uint32_t index[looked_at];
    double squared[looked_at];
    const std::size_t found = tree.knnSearch(points[i].data(), looked_at, index, squared);
    const double* other = std::find_if(squared, squared + found, [](double s) { return s > 0; });
    if (other != squared + found) nearest.push_back(std::sqrt(*other));
  }
  if (nearest.empty()) return 0;
  std::nth_element(nearest.begin(), nearest.begin() + nearest.size() / 2, nearest.end());
  return nearest[nearest.size() / 2];
}

}  // namespace bitr
