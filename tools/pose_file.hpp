// Poses in JSON files: what `bitr generate` and `bitr assemble --json` write.
#pragma once

#include <bitr/pose.hpp>
#include <bitr/result.hpp>
#include <string>

namespace bitr::tool {

/// The 4×4 matrix under "T_reference_source" or "transform". `bad_file` when it is not there or is no rigid
/// motion.
Result<Pose> read_pose(const std::string& path);

}  // namespace bitr::tool
