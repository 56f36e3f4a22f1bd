#include "manual.hpp"

#include <CLI/CLI.hpp>
#include <sstream>

#include "command_tree.hpp"

namespace bitr::tool {
namespace {

std::string replaced(std::string text, std::string_view from, std::string_view to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
    text.replace(at, from.size(), to);
  return text;
}

/// Lines of a help's end that belong together: prose, or what is indented to be read as it stands.
struct Block {
  bool as_is = false;
  std::vector<std::string> lines;
};

std::vector<Block> blocks_of(const std::string& footer) {
  std::vector<Block> blocks;
  std::istringstream lines(footer);
  bool apart = true;
  for (std::string line; std::getline(lines, line);) {
    const bool as_is = line.starts_with("  ");
    if (line.empty()) {
      apart = true;
      continue;
    }
    // What a line says of itself ("Exit status: …", "Examples:") stands by itself.
    const bool heading = line.starts_with("Exit status:") || line.ends_with(":");
    if (apart || heading || blocks.back().as_is != as_is) blocks.push_back({as_is, {}});
    blocks.back().lines.push_back(as_is ? line.substr(2) : line);
    apart = heading && line.ends_with(":");
  }
  return blocks;
}

std::string markdown_text(std::string text) {
  for (const char* mark : {"*", "<", "["}) text = replaced(text, mark, std::string("\\") + mark);
  return text;
}

/// " FILE", "[=none|icp|ot]".
std::string value_text(const CLI::Option& option) {
  if (!takes_value(option)) return "";
  const std::string type = option.get_type_name() + (option.get_expected_max() > 1 ? " …" : "");
  return value_optional(option) ? "[=" + type + "]" : " " + type;
}

std::string anchor(const std::string& name) { return "#" + replaced(name, " ", "-"); }

std::string excluded(const CLI::Option& option, const std::string& before, const std::string& after) {
  std::vector<std::string> names;
  for (const CLI::Option* other : option.get_excludes()) names.push_back(before + other->get_name() + after);
  return names.empty() ? "" : "; not with " + joined(names, ", ");
}

std::string cell(const std::string& text) { return " " + replaced(text, "|", "\\|") + " |"; }

std::string positionals_table(const CLI::App& app) {
  std::string text;
  for (const CLI::Option* option : positionals_of(app)) {
    if (text.empty()) text = "| argument | | |\n|---|---|---|\n";
    const std::string many = option->get_expected_max() > 1 ? "…" : "";
    text += "|" + cell("`" + option->get_name(true) + many + "`") +
            cell("`" + option->get_type_name() + "`" + (option->get_required() ? "" : ", optional")) +
            cell(markdown_text(option->get_description())) + "\n";
  }
  return text.empty() ? text : text + "\n";
}

std::string options_table(const CLI::App& app) {
  std::string text;
  for (const CLI::Option* option : options_of(app)) {
    if (text.empty()) text = "| option | default | |\n|---|---|---|\n";
    std::string otherwise = option->get_default_str();
    if (!otherwise.empty())
      otherwise = (value_optional(*option) ? "without a value: `" : "`") + otherwise + "`";
    if (option->get_required()) otherwise = "required";
    text += "|" + cell("`" + joined(spellings(*option), "`, `") + value_text(*option) + "`") +
            cell(otherwise) + cell(markdown_text(option->get_description()) + excluded(*option, "`", "`")) +
            "\n";
  }
  return text.empty() ? text : text + "\n";
}

std::string markdown_footer(const std::string& footer) {
  std::string text;
  for (const Block& block : blocks_of(footer)) {
    for (const std::string& line : block.lines)
      text += block.as_is ? "    " + line + "\n" : markdown_text(line) + "\n";
    text += "\n";
  }
  return text;
}

// A line that begins with a full stop or an apostrophe is a request to roff.
std::string roff(const std::string& plain) {
  std::string text = replaced(replaced(plain, "\\", "\\e"), "-", "\\-");
  if (text.starts_with('.') || text.starts_with('\'')) text.insert(0, "\\&");
  return text;
}

std::string roff_footer(const std::string& footer) {
  std::string text;
  for (const Block& block : blocks_of(footer)) {
    text += block.as_is ? ".RS 2\n.nf\n" : ".PP\n";
    for (const std::string& line : block.lines) text += roff(line) + "\n";
    if (block.as_is) text += ".fi\n.RE\n";
  }
  return text;
}

std::string roff_options(const CLI::App& app) {
  std::string text;
  for (const CLI::Option* option : positionals_of(app))
    text += ".TP\n\\fI" + roff(option->get_name(true)) + "\\fR\n" + roff(option->get_description()) + "\n";
  for (const CLI::Option* option : options_of(app)) {
    std::vector<std::string> names;
    for (const std::string& word : spellings(*option)) names.push_back("\\fB" + roff(word) + "\\fR");
    const std::string type = roff(value_text(*option)), otherwise = option->get_default_str();
    text += ".TP\n" + joined(names, ", ") + (type.empty() ? "" : "\\fI" + type + "\\fR") + "\n" +
            roff(option->get_description() + excluded(*option, "", ""));
    if (option->get_required())
      text += "; required";
    else if (!otherwise.empty())
      text += roff(value_optional(*option) ? "; without a value: " : "; default: ") + roff(otherwise);
    text += "\n";
  }
  return text;
}

}  // namespace

std::string markdown_manual(const CLI::App& root) {
  const std::vector<TreeEntry> tree = tree_of(root);
  std::string text = "# The command\n\n" + root.get_description() +
                     " `bitr help --markdown` prints this page; `--help` after any command says the same, "
                     "and so does the man\npage `bitr(1)`.\n\n| command | |\n|---|---|\n";
  for (const TreeEntry& entry : tree)
    if (entry.app != &root)
      text += "|" + cell("[`" + entry.name + "`](" + anchor(entry.name) + ")") +
              cell(entry.app->get_description()) + "\n";
  for (const TreeEntry& entry : tree) {
    if (entry.app == &root) {
      text += "\n" + markdown_footer(root.get_footer());
      continue;
    }
    text += "## " + entry.name + "\n\n" + markdown_text(entry.app->get_description()) + ".\n\n    " +
            usage_of(entry) + "\n\n" + positionals_table(*entry.app) + options_table(*entry.app) +
            markdown_footer(entry.app->get_footer());
  }
  while (text.ends_with("\n\n")) text.pop_back();
  return text;
}

std::string man_page(const CLI::App& root, const std::string& version) {
  std::string text = ".TH BITR 1 \"\" \"" + roff("bitr " + version) +
                     "\" \"User Commands\"\n.SH NAME\nbitr \\- assembles pairs of 3\\-D point clouds\n"
                     ".SH SYNOPSIS\n.nf\n";
  const std::vector<TreeEntry> tree = tree_of(root);
  for (const TreeEntry& entry : tree)
    if (entry.app->get_require_subcommand_min() == 0) text += roff(usage_of(entry)) + "\n";
  text += ".fi\n.SH DESCRIPTION\n" + roff(root.get_description()) + "\n" + roff_footer(root.get_footer()) +
          ".SH COMMANDS\n";
  for (const TreeEntry& entry : tree)
    if (entry.app != &root)
      text += ".SS \"" + roff(entry.name) + "\"\n" + roff(entry.app->get_description()) + ".\n" +
              roff_options(*entry.app) + roff_footer(entry.app->get_footer());
  return text +
         ".SH EXIT STATUS\n0: done. 1: ran, but the result is not to be used. 2: bad input or usage.\n";
}

}  // namespace bitr::tool
