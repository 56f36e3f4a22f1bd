// The manual, made of the same definitions as --help.
#pragma once

#include <string>

#include "cli.hpp"

namespace bitr::tool {

/// docs/cli.md: every command with its usage, arguments, options and the end of its help.
std::string markdown_manual(const CLI::App& root);
/// bitr(1), for man.
std::string man_page(const CLI::App& root, const std::string& version);

}  // namespace bitr::tool
