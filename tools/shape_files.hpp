// Files of shapes that a command crops.
#pragma once

#include <bitr/result.hpp>
#include <string>

#include "output.hpp"

namespace bitr::tool {

/// Every mesh and cloud in the folder and below, or the one file, whatever split it falls in. `io` when the
/// folder cannot be listed, `invalid_argument` when there is none.
Result<InputFiles> shape_files(const std::string& path);

}  // namespace bitr::tool
