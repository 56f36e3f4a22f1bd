// Where the tests find what they read. Not macros: an object with a path in it would be another one in every clone.
#pragma once

#include <filesystem>

namespace bitr::test {

std::filesystem::path source_dir();  ///< the project's root
std::filesystem::path data_dir();    ///< tests/data

}  // namespace bitr::test
