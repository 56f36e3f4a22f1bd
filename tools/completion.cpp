#include "completion.hpp"

#include <CLI/CLI.hpp>

#include "command_tree.hpp"

namespace bitr::tool {
namespace {

/// For a shell, in single quotes; `quote` is how one is written within them.
std::string quoted(const std::string& text, const std::string& quote) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? quote : std::string(1, c);
  return out + "'";
}
std::string in_shell(const std::string& text) { return quoted(text, "'\\''"); }

/// The words after "bitr".
std::string path_of(const TreeEntry& entry) {
  const std::size_t blank = entry.name.find(' ');
  return blank == std::string::npos ? "" : entry.name.substr(blank + 1);
}

std::vector<std::string> command_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : commands_of(app)) names.push_back(command->get_name());
  return names;
}

std::vector<std::string> option_words(const CLI::App& app) {
  std::vector<std::string> words;
  for (const CLI::Option* option : options_of(app))
    for (const std::string& word : spellings(*option)) words.push_back(word);
  words.insert(words.end(), {"-h", "--help"});
  return words;
}

/// What bash offers for these values: "words", and letters for files and folders.
std::string bash_offer(const Values& values) {
  return "words=" + in_shell(joined(values.words, " ")) + (values.files ? " files=-f" : "") +
         (values.folders ? " files=-d" : "");
}

Values positional_values(const CLI::App& app) {
  Values all;
  for (const CLI::Option* option : positionals_of(app)) {
    const Values values = values_of(*option);
    all.words.insert(all.words.end(), values.words.begin(), values.words.end());
    all.files |= values.files;
    all.folders |= values.folders;
  }
  return all;
}

}  // namespace

std::string bash_completion(const CLI::App& root) {
  std::string known, values, plain;
  for (const TreeEntry& entry : tree_of(root)) {
    const std::string path = path_of(entry);
    if (entry.app != &root) known += (known.empty() ? "" : " | ") + in_shell(path);
    for (const CLI::Option* option : options_of(*entry.app)) {
      if (!takes_value(*option)) continue;
      std::vector<std::string> patterns;
      for (const std::string& word : spellings(*option)) patterns.push_back(in_shell(path + ":" + word));
      values += "    " + joined(patterns, " | ") + ") " + bash_offer(values_of(*option)) + " ;;\n";
    }
    const auto commands = command_names(*entry.app);
    plain += "      " + in_shell(path) + ") options=" + in_shell(joined(option_words(*entry.app), " ")) + " ";
    plain +=
        commands.empty() ? bash_offer(positional_values(*entry.app)) : bash_offer({commands, false, false});
    plain += " ;;\n";
  }
  return "# bash completion of bitr; made by: bitr completion bash\n"
         "_bitr() {\n"
         "  local current=${COMP_WORDS[COMP_CWORD]} option=${COMP_WORDS[COMP_CWORD-1]} path= words= files= "
         "options= i\n"
         "  # \"=\" is a word of its own in --option=value.\n"
         "  if [[ $current == '=' ]]; then\n"
         "    current=\n"
         "  elif [[ $option == '=' ]] && ((COMP_CWORD > 1)); then\n"
         "    option=${COMP_WORDS[COMP_CWORD-2]}\n"
         "  fi\n"
         "  for ((i = 1; i < COMP_CWORD; ++i)); do\n"
         "    case \"${path:+$path }${COMP_WORDS[i]}\" in\n"
         "      " +
         known +
         ") path=\"${path:+$path }${COMP_WORDS[i]}\" ;;\n"
         "      *) break ;;\n"
         "    esac\n"
         "  done\n"
         "  case \"$path:$option\" in\n" +
         values +
         "    *)\n"
         "      case \"$path\" in\n" +
         plain +
         "      esac\n"
         "      if [[ $current == -* ]]; then words=$options files=; fi ;;\n"
         "  esac\n"
         "  COMPREPLY=()\n"
         "  local IFS=$'\\n'\n"
         "  if [[ -n $files ]]; then\n"
         "    compopt -o filenames 2>/dev/null\n"
         "    COMPREPLY=($(compgen $files -- \"$current\"))\n"
         "  fi\n"
         "  COMPREPLY+=($(compgen -W \"${words// /$'\\n'}\" -- \"$current\"))\n"
         "}\n"
         "complete -F _bitr bitr\n";
}

namespace {

std::string zsh_action(const Values& values) {
  const std::string words = "(" + joined(values.words, " ") + ")";
  if (values.files && !values.words.empty())
    return ":value:{_alternative \"words\\:word\\:" + words + "\" \"files\\:file\\:_files\"}";
  if (values.files) return ":file:_files";
  if (values.folders) return ":folder:_files -/";
  if (!values.words.empty()) return ":word:" + words;
  return ":value: ";
}

std::string zsh_text(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '[' || c == ']' || c == ':' || c == '\\') out += '\\';
    out += c;
  }
  return out;
}

std::string zsh_function(const TreeEntry& entry) {
  std::string name = "_bitr";
  for (const char c : path_of(entry)) name += c == ' ' ? '_' : c;
  return entry.name == "bitr" ? name : "_bitr_" + name.substr(5);
}

}  // namespace

std::string zsh_completion(const CLI::App& root) {
  std::string text = "#compdef bitr\n# zsh completion of bitr; made by: bitr completion zsh\n";
  for (const TreeEntry& entry : tree_of(root)) {
    text += zsh_function(entry) + "() {\n  local context state state_descr line\n  typeset -A opt_args\n";
    text += "  _arguments -C \\\n    '(-h --help)'{-h,--help}'[Print the help]'";
    for (const CLI::Option* option : options_of(*entry.app))
      for (const std::string& word : spellings(*option)) {
        const std::string value =
            takes_value(*option) ? (value_optional(*option) ? ":" : "") + zsh_action(values_of(*option)) : "";
        const std::string equals = takes_value(*option) && word.starts_with("--") ? "=" : "";
        text +=
            " \\\n    " + in_shell(word + equals + "[" + zsh_text(option->get_description()) + "]" + value);
      }
    const auto commands = commands_of(*entry.app);
    if (commands.empty()) {
      for (const CLI::Option* option : positionals_of(*entry.app)) {
        const bool many = option->get_expected_max() > 1;
        text += " \\\n    " + in_shell((many ? "*" : "") + zsh_action(values_of(*option)));
      }
      text += "\n}\n";
      continue;
    }
    text +=
        " \\\n    '1: :->command' '*:: :->rest'\n  case $state in\n    command)\n      local -a commands\n"
        "      commands=(\n";
    for (const CLI::App* command : commands)
      text += "        " + in_shell(command->get_name() + ":" + zsh_text(command->get_description())) + "\n";
    text += "      )\n      _describe command commands ;;\n    rest) case $words[1] in\n";
    for (const CLI::App* command : commands)
      text += "      " + command->get_name() + ") " +
              zsh_function({entry.name + " " + command->get_name(), command}) + " ;;\n";
    text += "    esac ;;\n  esac\n}\n";
  }
  return text + "_bitr \"$@\"\n";
}

std::string fish_completion(const CLI::App& root) {
  const auto in_fish = [](const std::string& text) { return quoted(text, "\\'"); };
  std::string text = "# fish completion of bitr; made by: bitr completion fish\ncomplete -c bitr -f\n";
  for (const TreeEntry& entry : tree_of(root)) {
    // Where this command's words belong: after all of its own, before those of a command below it.
    std::string where;
    const std::string path = path_of(entry);
    for (std::size_t at = 0; at < path.size();) {
      const std::size_t end = std::min(path.find(' ', at), path.size());
      where += (where.empty() ? "" : "; and ") + ("__fish_seen_subcommand_from " + path.substr(at, end - at));
      at = end + 1;
    }
    const auto commands = commands_of(*entry.app);
    if (!commands.empty()) {
      const std::string below = "not __fish_seen_subcommand_from " + joined(command_names(*entry.app), " ");
      where += (where.empty() ? "" : "; and ") + below;
    }
    const std::string start = "complete -c bitr -n " + in_fish(where);
    for (const CLI::App* command : commands)
      text += start + " -a " + command->get_name() + " -d " + in_fish(command->get_description()) + "\n";
    const auto offer = [&](const Values& values) {
      return std::string(values.files ? " -F" : "") +
             (values.folders ? " -a '(__fish_complete_directories)'" : "") +
             (values.words.empty() ? "" : " -a " + in_fish(joined(values.words, " ")));
    };
    for (const CLI::Option* option : options_of(*entry.app)) {
      text += start;
      for (const std::string& word : spellings(*option))
        text += word.starts_with("--") ? " -l " + word.substr(2) : " -s " + word.substr(1);
      const Values values = values_of(*option);
      if (takes_value(*option))
        text +=
            std::string(value_optional(*option) ? "" : " -r") + (values.files ? "" : " -f") + offer(values);
      text += " -d " + in_fish(option->get_description()) + "\n";
    }
    if (const std::string words = offer(positional_values(*entry.app)); !words.empty() && commands.empty())
      text += start + words + "\n";
  }
  return text;
}

}  // namespace bitr::tool
