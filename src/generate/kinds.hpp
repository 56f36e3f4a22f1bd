// One function per kind. It returns both clouds in the assembled frame, free of noise; generate_pair moves
// them apart. To add a kind: a file beside this one, a declaration here, a row in generate.cpp.
#pragma once

#include <bitr/generate.hpp>

#include "core/random.hpp"

namespace bitr::generate {

struct Assembled {
  PointCloud source;
  PointCloud reference;
};

/// A solid broken in two along a rough, curved surface.
Assembled fragments(const GenerateOptions& options, Random& random);

/// A solid, twice: the reference has the source's points in the same order.
Assembled copy(const GenerateOptions& options, Random& random);

}  // namespace bitr::generate
