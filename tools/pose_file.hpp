// Poses in files, JSON as `bitr generate` and `bitr assemble --json` write it or 4×4 numbers, and in reports.
#pragma once

#include <bitr/pose.hpp>
#include <bitr/result.hpp>
#include <cstdio>
#include <optional>
#include <string>

#include "output.hpp"

namespace bitr::tool {

/// The 4×4 matrix under "T_reference_source" or "transform" of a JSON object; of any other file its numbers,
/// four lines of four. `bad_file` when it is not there or is no rigid motion.
Result<Pose> read_pose(const std::string& path);
/// The same of an option's file; an empty path names none.
Result<std::optional<Pose>> read_optional_pose(const std::string& path);

/// For write_files: four lines of four numbers, each with as few digits as give its double back.
FileWriter pose_writer(const std::string& path, const Pose& pose);

/// A 4×4 matrix, row by row. `bad_file` when it is no rigid motion; the message begins with `name`.
Result<Pose> parse_pose(const Json& matrix, const std::string& name);

/// The matrix, four lines under "T_reference_source".
void print_matrix(const Pose& T_reference_source, std::FILE* out);
/// "transform", the 4×4 matrix, and its parts, "rotation" and "translation".
Json pose_json(const Pose& pose);
/// "rotation_degrees" and "translation": how far the pose is from the true one.
Json errors_json(const Pose& pose, const Pose& truth);

}  // namespace bitr::tool
