// Runs the built command the way a shell would.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace bitr::test {

struct Finished {
  int status = -1;  ///< exit status; 128 + signal when it was killed
  std::string out, err;
};

/// `environment`: NAME=value, beside the test's own. The cache folder is a fresh one unless it says so.
Finished run_command(const std::vector<std::string>& arguments,
                     const std::vector<std::string>& environment = {});

/// run_command under a limit of the system's, as RLIMIT_FSIZE, that is lifted again.
Finished run_limited(int resource, std::uint64_t limit, const std::vector<std::string>& arguments);

/// Starts the command and lets it run that long before it gets the signal; returns its status as in Finished.
int run_and_signal(const std::vector<std::string>& arguments, std::chrono::milliseconds wait, int signal);

/// A fresh folder, removed with everything in it at the end.
class Folder {
 public:
  Folder();
  ~Folder();
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  std::string path(const std::string& name = {}) const { return (root_ / name).string(); }
  std::string write(const std::string& name, const std::string& content) const;
  /// Names of everything in it, sorted.
  std::vector<std::string> names() const;

 private:
  std::filesystem::path root_;
};

std::string read_text(const std::string& path);
nlohmann::json read_json(const std::string& path);

/// The paths of pair 0 of `kind`, made in `folder`.
struct PairFiles {
  std::string source, reference, truth;
};
PairFiles generate_files(const Folder& folder, const std::string& kind, const std::string& points = "500",
                         const std::string& seed = "1");

}  // namespace bitr::test
