// What the command consists of, as its options define it: for the manual and for shells that complete words.
#pragma once

#include <string>
#include <vector>

#include "cli.hpp"

namespace bitr::tool {

/// A command, and the words that call it: "bitr", "bitr model info".
struct TreeEntry {
  std::string name;
  const CLI::App* app;
};
/// The root first, then its commands in the order of --help, each before its own.
std::vector<TreeEntry> tree_of(const CLI::App& root);

/// Its own commands.
std::vector<const CLI::App*> commands_of(const CLI::App& app);
std::vector<const CLI::Option*> positionals_of(const CLI::App& app);
/// Without --help, which every command has.
std::vector<const CLI::Option*> options_of(const CLI::App& app);
/// "-o", "--output".
std::vector<std::string> spellings(const CLI::Option& option);
bool takes_value(const CLI::Option& option);
/// Whether it may also stand alone.
bool value_optional(const CLI::Option& option);
/// "bitr assemble [OPTIONS] SOURCE REFERENCE".
std::string usage_of(const TreeEntry& entry);

/// What may follow an option, or stand as a positional.
struct Values {
  std::vector<std::string> words;  ///< one of these
  bool files = false, folders = false;
};
/// By the type that --help shows: FILE is a file, DIR a folder, words in small letters stand for themselves,
/// FILE|NAME is a model.
Values values_of(const CLI::Option& option);

std::string joined(const std::vector<std::string>& words, const std::string& between);

}  // namespace bitr::tool
