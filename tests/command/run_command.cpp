#include "run_command.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>
#include <string_view>
#include <thread>

extern char** environ;

namespace bitr::test {

Finished run_command(const std::vector<std::string>& arguments, const std::vector<std::string>& environment) {
  const Folder folder;
  const std::string out = folder.path("out"), err = folder.path("err");
  std::vector<std::string> words = {BITR_COMMAND};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);

  // The first of a name wins. Mesa keeps the cache it has: compiling everything anew takes it seconds.
  std::vector<std::string> variables = environment;
  const char *cache = std::getenv("XDG_CACHE_HOME"), *home = std::getenv("HOME");
  if (!std::getenv("MESA_SHADER_CACHE_DIR") && (cache || home))
    variables.push_back("MESA_SHADER_CACHE_DIR=" +
                        (cache ? std::string(cache) : home + std::string("/.cache")));
  variables.push_back("XDG_CACHE_HOME=" + folder.path("cache"));
  std::vector<char*> envp;
  const auto add = [&](char* variable) {
    const std::string_view name(variable, std::strcspn(variable, "=") + 1);
    if (std::none_of(envp.begin(), envp.end(),
                     [&](const char* other) { return std::string_view(other).starts_with(name); }))
      envp.push_back(variable);
  };
  for (std::string& variable : variables) add(variable.data());
  for (char** variable = environ; *variable; ++variable) add(*variable);
  envp.push_back(nullptr);

  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, out.c_str(), O_WRONLY | O_CREAT, 0600);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, err.c_str(), O_WRONLY | O_CREAT, 0600);
  pid_t child = 0;
  const int spawned = posix_spawn(&child, BITR_COMMAND, &actions, nullptr, argv.data(), envp.data());
  posix_spawn_file_actions_destroy(&actions);
  // What run_limited leaves may not do for a process, even for a moment.
  EXPECT_TRUE(spawned == 0 || spawned == ENOMEM) << BITR_COMMAND;
  if (spawned != 0) return {.status = 127, .out = {}, .err = {}};

  int state = 0;
  waitpid(child, &state, 0);
  return {WIFEXITED(state) ? WEXITSTATUS(state) : 128 + WTERMSIG(state), read_text(out), read_text(err)};
}

Finished run_limited(int resource, std::uint64_t limit, const std::vector<std::string>& arguments) {
  rlimit old{};
  EXPECT_EQ(getrlimit(resource, &old), 0);
  const rlimit tight{limit, old.rlim_max};
  EXPECT_EQ(setrlimit(resource, &tight), 0);
  Finished finished = run_command(arguments);
  EXPECT_EQ(setrlimit(resource, &old), 0);
  return finished;
}

int run_and_signal(const std::vector<std::string>& arguments, std::chrono::milliseconds wait, int signal) {
  std::vector<std::string> words = {BITR_COMMAND};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  const pid_t child = fork();
  if (child == 0) {
    const int null = open("/dev/null", O_RDWR);
    for (const int number : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) dup2(null, number);
    execv(BITR_COMMAND, argv.data());
    _exit(127);
  }
  std::this_thread::sleep_for(wait);
  kill(child, signal);
  int state = 0;
  waitpid(child, &state, 0);
  return WIFEXITED(state) ? WEXITSTATUS(state) : 128 + WTERMSIG(state);
}

Folder::Folder() {
  std::string pattern = (std::filesystem::temp_directory_path() / "bitr_command_XXXXXX").string();
  EXPECT_NE(mkdtemp(pattern.data()), nullptr);
  root_ = pattern;
}

Folder::~Folder() {
  std::error_code ignored;
  std::filesystem::remove_all(root_, ignored);
}

std::string Folder::write(const std::string& name, const std::string& content) const {
  std::ofstream(path(name), std::ios::binary) << content;
  return path(name);
}

std::vector<std::string> Folder::names() const {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(root_))
    names.push_back(entry.path().filename().string());
  std::sort(names.begin(), names.end());
  return names;
}

std::string read_text(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  EXPECT_TRUE(file) << path;
  return {std::istreambuf_iterator<char>(file), {}};
}

nlohmann::json read_json(const std::string& path) {
  auto json = nlohmann::json::parse(read_text(path), nullptr, false);
  EXPECT_FALSE(json.is_discarded()) << path;
  return json;
}

PairFiles generate_files(const Folder& folder, const std::string& kind, const std::string& points,
                         const std::string& seed) {
  const Finished made = run_command(
      {"generate", kind, "--out", folder.path(), "--count", "1", "--seed", seed, "--points", points});
  EXPECT_EQ(made.status, 0) << made.err;
  const std::string name = folder.path(kind + "_000_");
  return {name + "source.ply", name + "reference.ply", name + "truth.json"};
}

}  // namespace bitr::test
