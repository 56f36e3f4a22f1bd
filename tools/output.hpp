// What a command says and writes: errors as one line, JSON, files that appear whole or not at all.
#pragma once

#include <bitr/pose.hpp>
#include <bitr/result.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace bitr::tool {

using Json = nlohmann::ordered_json;

/// "bitr: message" on standard error, as one line whatever the message holds; returns the status.
int complain(int status, std::string_view message);
/// The same with the exit status that the error's kind has. Where it is not the input's fault, as
/// when memory runs out, what is at hand takes the prefix's place.
int complain(const Error& error, std::string_view prefix = {});
void warn(std::string_view message);

/// What the command has set out to do, and how large it is: the most telling thing to say when memory or
/// threads run out.
void set_at_hand(std::string what);
/// As a prefix of a message; empty before anything was set.
std::string at_hand();

/// A line on the terminal that says how far the work is, until it is cleared or something else is said;
/// nothing when standard error is not a terminal.
void show_progress(std::string_view text);
void clear_progress();

/// `invalid_argument` naming `option` when a file could not be made at `path`, it is one of `inputs`, or it is
/// a symbolic link to nothing. Found out before the work rather than after it. An empty path and "-" pass.
Result<void> check_output(std::string_view option, const std::string& path,
                          const std::vector<std::string>& inputs = {});

/// What an option asks to be written; an empty path asks for nothing.
struct OutputFile {
  std::string_view option;
  std::string path;
  std::string_view what = {};  ///< "a cloud", which needs a file; empty: "-" is standard output
};
/// check_output of each, and no two of them the same file.
Result<void> check_outputs(const std::vector<OutputFile>& files, const std::vector<std::string>& inputs);

/// Files that are read, to be known again by any of their names.
class InputFiles {
 public:
  /// What is not there is passed over.
  void add(const std::string& path);
  bool has(const std::string& path) const;
  bool empty() const { return files_.empty(); }

 private:
  std::set<std::pair<std::uint64_t, std::uint64_t>> files_;
};

/// The folder, made with those above it if it is missing. `invalid_argument` naming `option`.
Result<void> make_folder(std::string_view option, const std::string& path);

using Bytes = std::vector<std::byte>;
Bytes bytes_of(std::string_view text);

/// A file and what is to stand in it, "-" for standard output; an empty path is passed over. `path` is for
/// the errors of `make`.
struct FileWriter {
  std::string path;
  std::function<Result<Bytes>(const std::string& path)> make;
};
/// Every file that the command was asked for: all of them appear, or none, and then what was there before is
/// still there. What goes to standard output, pipes and devices cannot be taken back, and goes first.
Result<void> write_files(const std::vector<FileWriter>& files);

FileWriter json_writer(const std::string& path, const Json& json);
/// write_files of this one.
Result<void> write_json(const std::string& path, const Json& json);

/// null when it is empty.
template <class T>
Json optional_json(const std::optional<T>& value) {
  return value ? Json(*value) : Json(nullptr);
}

/// Four rows of the homogeneous matrix.
Json matrix_json(const Pose& pose);

}  // namespace bitr::tool
