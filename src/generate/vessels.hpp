// Pots, cups, bottles: things turned on a wheel.
#pragma once

#include <memory>

#include "generate/shape.hpp"

namespace bitr::generate {

/// A body of revolution about z with a random profile, most of them hollow; some have handles, a spout or a
/// lip to pour from. Without those the shape is symmetric about z, with two equal handles to a half-turn.
std::unique_ptr<Shape> random_vessel(Random& random);

}  // namespace bitr::generate
