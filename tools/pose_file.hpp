// Poses in JSON files: what `bitr generate` and `bitr assemble --json` write.
#pragma once

#include <bitr/pose.hpp>
#include <bitr/result.hpp>
#include <string>

#include "output.hpp"

namespace bitr::tool {

/// The 4×4 matrix under "T_reference_source" or "transform". `bad_file` when it is not there or is no rigid
/// motion.
Result<Pose> read_pose(const std::string& path);

/// A 4×4 matrix, row by row. `bad_file` when it is no rigid motion; the message begins with `name`.
Result<Pose> parse_pose(const Json& matrix, const std::string& name);

}  // namespace bitr::tool
