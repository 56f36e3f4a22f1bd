// The manual and the shells' completion, against what --help prints.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <regex>
#include <set>
#include <sstream>

#include "run_command.hpp"
#include "support/paths.hpp"

namespace bitr::test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::IsSupersetOf;

using Words = std::vector<std::string>;

std::string output_of(const Words& words) {
  const Finished finished = run_command(words);
  EXPECT_EQ(finished.status, 0) << finished.err;
  return finished.out;
}

/// Status, and what a shell command prints.
std::pair<int, std::string> shell(const std::string& command) {
  std::FILE* pipe = popen(command.c_str(), "r");
  std::string out;
  char block[4096];
  for (std::size_t size; (size = std::fread(block, 1, sizeof block, pipe)) > 0;) out.append(block, size);
  return {pclose(pipe), out};
}
bool there_is(const std::string& program) { return shell("command -v " + program).first == 0; }

/// The words under a heading of --help, one for every spelling.
std::set<std::string> listed(const std::string& help, const std::string& heading) {
  std::set<std::string> words;
  std::istringstream lines(help);
  bool under = false;
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with("  ")) under = line == heading;
    if (!under || !line.starts_with("  ") || line[2] == ' ') continue;
    std::istringstream names(line.substr(2, line.find(' ', 2) - 2));
    for (std::string name; std::getline(names, name, ',');) words.insert(name);
  }
  return words;
}

const std::vector<Words> commands = {{},
                                     {"assemble"},
                                     {"batch"},
                                     {"generate"},
                                     {"bench"},
                                     {"devices"},
                                     {"doctor"},
                                     {"eval"},
                                     {"train"},
                                     {"refine"},
                                     {"model"},
                                     {"model", "info"},
                                     {"model", "convert"},
                                     {"help"},
                                     {"completion"}};

Words help_of(Words words) {
  words.push_back("--help");
  return words;
}

std::string quoted(const std::string& word) { return "'" + word + "'"; }

class BashCompletion : public testing::Test {
 protected:
  /// What bash offers for the last of the words after "bitr".
  Words offered(const Words& words) const {
    std::string line = "cd " + folder.path() + "; source ./bitr.bash; COMP_WORDS=(bitr";
    for (const std::string& word : words) line += " " + quoted(word);
    line += "); COMP_CWORD=" + std::to_string(words.size()) + "; _bitr; printf '%s\\n' \"${COMPREPLY[@]}\"";
    folder.write("try.sh", line);
    const auto [status, out] = shell("bash --norc " + folder.path("try.sh"));
    EXPECT_EQ(status, 0);
    Words offers;
    std::istringstream lines(out);
    for (std::string offer; std::getline(lines, offer);)
      if (!offer.empty()) offers.push_back(offer);
    std::sort(offers.begin(), offers.end());
    return offers;
  }
  Folder folder;
  std::string script = folder.write("bitr.bash", output_of({"completion", "bash"}));
};

TEST_F(BashCompletion, OffersEveryOptionAndCommandOfTheHelp) {
  EXPECT_EQ(shell("bash -n " + script).first, 0);
  for (const Words& command : commands) {
    const std::string help = output_of(help_of(command));
    Words words = command;
    words.push_back("-");
    const auto options = offered(words);
    EXPECT_EQ(std::set<std::string>(options.begin(), options.end()), listed(help, "Options:"))
        << testing::PrintToString(command);
    words.back() = "";
    const auto below = listed(help, "Subcommands:");
    if (!below.empty()) {
      const auto found = offered(words);
      EXPECT_EQ(std::set<std::string>(found.begin(), found.end()), below);
    }
  }
}

TEST_F(BashCompletion, OffersWhatAnOptionTakes) {
  folder.write("a b.ply", "");
  folder.write("c.ply", "");
  std::filesystem::create_directory(folder.path("clouds"));
  const Words files = {"a b.ply", "bitr.bash", "c.ply", "clouds", "try.sh"};
  EXPECT_THAT(offered({"as"}), ElementsAre("assemble"));
  EXPECT_THAT(offered({"model", "c"}), ElementsAre("convert"));
  EXPECT_THAT(offered({"assemble", "--refi"}), ElementsAre("--refine"));
  EXPECT_THAT(offered({"assemble", "a", "--refine", ""}), ElementsAre("icp", "none", "ot"));
  // As readline divides --refine=o.
  EXPECT_THAT(offered({"assemble", "a", "--refine", "="}), ElementsAre("icp", "none", "ot"));
  EXPECT_THAT(offered({"assemble", "a", "--refine", "=", "o"}), ElementsAre("ot"));
  EXPECT_THAT(offered({"refine", "--method", ""}), ElementsAre("icp", "ot"));
  EXPECT_THAT(offered({"assemble", "--yaw-only", ""}), ElementsAre("x", "y", "z"));
  EXPECT_THAT(offered({"assemble", "--threads", ""}), IsEmpty());
  EXPECT_THAT(offered({"assemble", "--model", "a"}), ElementsAre("a b.ply", "aircraft"));
  EXPECT_THAT(offered({"assemble", "c"}), ElementsAre("c.ply", "clouds"));
  EXPECT_EQ(offered({"assemble", "one.ply", ""}), files);
  EXPECT_EQ(offered({"assemble", "--truth", ""}), files);
  EXPECT_THAT(offered({"batch", "pairs.csv", "--out", "c"}), ElementsAre("clouds"));
  EXPECT_THAT(offered({"generate", "v"}), ElementsAre("vessels"));
  EXPECT_THAT(offered({"completion", ""}), ElementsAre("bash", "fish", "zsh"));
  EXPECT_THAT(offered({"unknown", "--re"}), IsEmpty());
}

TEST(Completion, OtherShellsTakeTheirScripts) {
  const Folder folder;
  const std::string zsh = folder.write("_bitr", output_of({"completion", "zsh"})),
                    fish = folder.write("bitr.fish", output_of({"completion", "fish"}));
  for (const Words& command : commands)
    for (const std::string& word : listed(output_of(help_of(command)), "Options:")) {
      if (!word.starts_with("--") || word == "--help") continue;
      EXPECT_THAT(read_text(zsh), HasSubstr(word));
      EXPECT_THAT(read_text(fish), HasSubstr("-l " + word.substr(2) + " "));
    }
  for (const auto& [program, script] : {std::pair("zsh", zsh), {"fish", fish}})
    EXPECT_TRUE(!there_is(program) || shell(std::string(program) + " -n " + script).first == 0) << program;
  EXPECT_EQ(run_command({"completion", "tcsh"}).status, 2);
}

TEST(Manual, ThePageInTheDocumentationIsTheOneThatIsPrinted) {
  EXPECT_EQ(read_text((source_dir() / "docs/cli.md").string()), output_of({"help", "--markdown"}))
      << "bitr help --markdown > docs/cli.md";
}

TEST(Manual, HasEveryOptionWithItsTypeAndDescription) {
  const std::string markdown = output_of({"help", "--markdown"}), man = output_of({"help", "--man"});
  for (const Words& command : commands) {
    std::string name = "bitr";
    for (const std::string& word : command) name += " " + word;
    if (command.empty()) continue;
    const std::size_t begin = markdown.find("\n## " + name + "\n");
    ASSERT_NE(begin, std::string::npos) << name;
    const std::string section = markdown.substr(begin, markdown.find("\n## ", begin + 1) - begin);
    EXPECT_THAT(section, HasSubstr("    " + name + " [OPTIONS]"));
    for (const std::string& word : listed(output_of(help_of(command)), "Options:")) {
      if (word == "-h" || word == "--help") continue;
      EXPECT_THAT(section, HasSubstr("`" + word)) << name;
    }
    EXPECT_THAT(man, HasSubstr(".SS \"" + name + "\"\n"));
  }
  EXPECT_THAT(markdown, HasSubstr("| `--backend auto\\|vulkan\\|cpu` | `auto` | Where to run;"));
  EXPECT_THAT(markdown,
              HasSubstr("Exit status: 0 done; 1 ran, but the result is not to be used; 2 bad input"));
}

TEST(Manual, GroffHasNothingToSayAboutThePage) {
  if (!there_is("groff")) GTEST_SKIP() << "groff is not installed";
  const Folder folder;
  const std::string page = folder.write("bitr.1", output_of({"help", "--man"}));
  const auto [status, out] = shell("groff -man -Tutf8 -ww -k " + page + " 2>&1 >/dev/null");
  EXPECT_EQ(status, 0);
  EXPECT_EQ(out, "");
}

TEST(Manual, HelpOfACommandIsItsHelp) {
  for (const Words& command : commands) {
    Words words = {"help"};
    words.insert(words.end(), command.begin(), command.end());
    EXPECT_EQ(output_of(words), output_of(help_of(command))) << testing::PrintToString(command);
  }
  const Finished unknown = run_command({"help", "asemble"});
  EXPECT_EQ(unknown.status, 2);
  EXPECT_THAT(unknown.err, HasSubstr("\"bitr asemble\" is not a command"));
  EXPECT_EQ(run_command({"help", "--markdown", "--man"}).status, 2);
}

}  // namespace
}  // namespace bitr::test
