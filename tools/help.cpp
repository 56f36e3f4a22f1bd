// bitr help, bitr completion: what the command says about itself.
#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>

#include "command.hpp"
#include "command_tree.hpp"
#include "completion.hpp"
#include "manual.hpp"
#include "options.hpp"
#include "output.hpp"

namespace bitr::tool {
namespace {

struct HelpOptions {
  std::vector<std::string> words;
  bool markdown = false, man = false;
};

int run(const CLI::App& root, const HelpOptions& options) {
  if (options.markdown || options.man) {
    if (!options.words.empty() || (options.markdown && options.man))
      return complain(bad_usage, "--markdown and --man print the whole manual, one of them at a time");
    std::cout << (options.markdown ? markdown_manual(root) : man_page(root, BITR_VERSION));
    return done;
  }
  std::string name = root.get_name();
  for (const std::string& word : options.words) name += " " + word;
  for (const TreeEntry& entry : tree_of(root))
    if (entry.name == name) {
      const std::size_t last = name.rfind(' ');
      // Asked of the root, CLI11 would show the help of this very command.
      std::cout << (last == std::string::npos ? root.get_formatter()->make_help(&root, name, {})
                                              : entry.app->help(name.substr(0, last)));
      return done;
    }
  return complain(bad_usage, "\"" + name + "\" is not a command; see bitr --help");
}

}  // namespace

Command add_help(CLI::App& root) {
  auto options = std::make_shared<HelpOptions>();
  CLI::App* app = add_command(root, "help", "Explain a command, or print the whole manual");
  app->add_option("COMMAND", options->words, "Its words, as in: model info")->type_name("WORD");
  app->add_flag("--markdown", options->markdown, "Print the manual of all commands as Markdown");
  app->add_flag("--man", options->man, "Print it as a page for man");
  app->footer(
      "Examples:\n"
      "  bitr help assemble\n"
      "  bitr help --man | man -l -");
  return {app, [&root, options] { return run(root, *options); }};
}

Command add_completion(CLI::App& root) {
  using Write = std::string (*)(const CLI::App&);
  auto write = std::make_shared<Write>(nullptr);
  CLI::App* app = add_command(root, "completion", "Print a script that completes words in a shell");
  add_choice<Write>(*app, "SHELL",
                    {{"bash", bash_completion}, {"zsh", zsh_completion}, {"fish", fish_completion}}, *write,
                    "The shell it is for")
      ->required();
  app->footer(
      "Examples:\n"
      "  source <(bitr completion bash)                                   # in ~/.bashrc\n"
      "  bitr completion zsh > ~/.zfunc/_bitr                             # with ~/.zfunc in fpath\n"
      "  bitr completion fish > ~/.config/fish/completions/bitr.fish");
  return {app, [&root, write] {
            std::cout << (*write)(root);
            return static_cast<int>(done);
          }};
}

}  // namespace bitr::tool
