#include "command_tree.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <bitr/model.hpp>

namespace bitr::tool {
namespace {

void walk(const CLI::App& app, const std::string& before, std::vector<TreeEntry>& tree) {
  const std::string name = before.empty() ? app.get_name() : before + " " + app.get_name();
  tree.push_back({name, &app});
  for (const CLI::App* command : commands_of(app)) walk(*command, name, tree);
}

}  // namespace

std::vector<TreeEntry> tree_of(const CLI::App& root) {
  std::vector<TreeEntry> tree;
  walk(root, "", tree);
  return tree;
}

std::vector<const CLI::App*> commands_of(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App*) { return true; });
}

std::vector<const CLI::Option*> positionals_of(const CLI::App& app) {
  return app.get_options([](const CLI::Option* option) { return option->get_positional(); });
}

std::vector<const CLI::Option*> options_of(const CLI::App& app) {
  return app.get_options([&](const CLI::Option* option) {
    return option->nonpositional() && option != app.get_help_ptr() && !option->get_group().empty();
  });
}

std::vector<std::string> spellings(const CLI::Option& option) {
  std::vector<std::string> words;
  for (const std::string& name : option.get_snames()) words.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) words.push_back("--" + name);
  return words;
}

bool takes_value(const CLI::Option& option) { return option.get_items_expected_max() > 0; }

bool value_optional(const CLI::Option& option) {
  return takes_value(option) && option.get_items_expected_min() == 0;
}

std::string usage_of(const TreeEntry& entry) {
  std::string usage = entry.name + " [OPTIONS]";
  for (const CLI::Option* positional : positionals_of(*entry.app)) {
    std::string name = positional->get_name(true);
    if (positional->get_expected_max() > 1) name += "…";
    usage += positional->get_required() ? " " + name : " [" + name + "]";
  }
  if (entry.app->get_require_subcommand_min() > 0) usage += " COMMAND";
  return usage;
}

Values values_of(const CLI::Option& option) {
  Values values;
  const std::string type = option.get_type_name();
  for (std::size_t at = 0; at <= type.size();) {
    const std::size_t end = std::min(type.find('|', at), type.size());
    const std::string part = type.substr(at, end - at);
    at = end + 1;
    const bool own = std::any_of(part.begin(), part.end(), [](char c) { return c >= 'a' && c <= 'z'; });
    if (part.starts_with("FILE") || part == "PATH") {
      values.files = true;
    } else if (part == "DIR" || part == "FOLDER") {
      values.folders = true;
    } else if (part == "NAME" && values.files) {
      for (const ShippedModel& model : shipped_models()) values.words.emplace_back(model.name);
    } else if (own || part == "-") {
      values.words.push_back(part);
    }
  }
  return values;
}

std::string joined(const std::vector<std::string>& words, const std::string& between) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : between) + word;
  return text;
}

}  // namespace bitr::tool
