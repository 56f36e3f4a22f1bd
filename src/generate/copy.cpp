#include "generate/field.hpp"
#include "generate/kinds.hpp"
#include "generate/solid.hpp"

namespace bitr::generate {

Assembled copy(const GenerateOptions& options, Random& random) {
  const Solid solid = random_solid(random);
  const PointCloud cloud = sample_surface(solid, solid_radius, options.points, random);
  return {cloud, cloud};
}

}  // namespace bitr::generate
