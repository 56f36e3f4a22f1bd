// What a command says and writes: errors as one line, JSON, files that appear whole or not at all.
#pragma once

#include <bitr/pose.hpp>
#include <bitr/result.hpp>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace bitr::tool {

using Json = nlohmann::ordered_json;

/// "bitr: message" on standard error, as one line whatever the message holds; returns the status.
int complain(int status, std::string_view message);
/// The same with the exit status that the error's kind has.
int complain(const Error& error, std::string_view prefix = {});
void warn(std::string_view message);

/// A line on the terminal that says how far the work is, until it is cleared or something else is said;
/// nothing when standard error is not a terminal.
void show_progress(std::string_view text);
void clear_progress();

/// `invalid_argument` naming `option` when a file could not be made at `path`, or it is one of `inputs`.
/// Found out before the work rather than after it. An empty path and "-" pass.
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

/// A file and how it is written there; an empty path is passed over.
struct FileWriter {
  std::string path;
  std::function<Result<void>(const std::string& path)> write;
};
/// One after the other. When one fails, those before it are taken back: half of what was asked for is nothing
/// to go on with. What is no regular file stays.
Result<void> write_files(const std::vector<FileWriter>& files);

/// To the file, or to standard output when `path` is "-".
Result<void> write_json(const std::string& path, const Json& json);

/// null when it is empty.
template <class T>
Json optional_json(const std::optional<T>& value) {
  return value ? Json(*value) : Json(nullptr);
}

/// Four rows of the homogeneous matrix.
Json matrix_json(const Pose& pose);

}  // namespace bitr::tool
