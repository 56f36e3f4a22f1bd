// Poses of a smaller family: their options, and what is said of them.
#pragma once

#include <bitr/assemble.hpp>
#include <bitr/restriction.hpp>

#include "cli.hpp"
#include "output.hpp"

namespace bitr::tool {

/// --translation-only, --yaw-only [AXIS]
void add_restriction_options(CLI::App& app, Restriction& restriction);

/// restricted() of an assembly's pose: where the turn is not determined the assembly is degenerate. Nothing else
/// of its diagnostics changes.
Restricted restrict_assembly(const Restriction& restriction, const Vec3d& source_centroid,
                             Assembly& assembly);

/// The family alone, for settings.
Json to_json(const Restriction& restriction);
Json to_json(const Restricted& restricted);

}  // namespace bitr::tool
