#pragma once

#include <memory>

#include "generate/shape.hpp"

namespace bitr::generate {

/// An airliner, turboprop, business jet, light aeroplane, glider or fighter of random proportions: fuselage
/// along x with the nose at -x, wings, tail and, where it has them, engines; z is up. Only the mirror image
/// in y = 0 is the same, no rotation.
std::unique_ptr<Shape> random_aircraft(Random& random);

}  // namespace bitr::generate
