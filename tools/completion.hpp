// Scripts that teach a shell the command's words, made of the same definitions as --help.
#pragma once

#include <string>

#include "cli.hpp"

namespace bitr::tool {

std::string bash_completion(const CLI::App& root);
std::string zsh_completion(const CLI::App& root);
std::string fish_completion(const CLI::App& root);

}  // namespace bitr::tool
