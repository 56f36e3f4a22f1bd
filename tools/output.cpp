#include "output.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <iostream>

#include "command.hpp"
#include "io/staged_files.hpp"

namespace bitr::tool {
namespace {

bool progress_shown = false;
std::string task;

std::string one_line(std::string_view text) {
  std::string line;
  for (const char c : text) {
    const bool control = static_cast<unsigned char>(c) < 0x20 || c == 0x7f;
    line += control ? (c == '\n' ? ' ' : '?') : c;
  }
  return line;
}

// The files need not be there yet; their folders are.
bool same_file(const std::filesystem::path& a, const std::filesystem::path& b) {
  std::error_code error;
  if (a.empty() || b.empty()) return false;
  if (a == b || std::filesystem::equivalent(a, b, error)) return true;
  const auto folder = [](const std::filesystem::path& path) {
    return path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
  };
  return a.filename() == b.filename() && std::filesystem::equivalent(folder(a), folder(b), error);
}

int exit_status(ErrorCode code) {
  return code == ErrorCode::internal || code == ErrorCode::device_lost ? run_failed : bad_usage;
}

}  // namespace

int complain(int status, std::string_view message) {
  clear_progress();
  std::cerr << "bitr: " << one_line(message) << '\n';
  return status;
}

int complain(const Error& error, std::string_view prefix) {
  const bool ours = error.code == ErrorCode::internal && !task.empty();
  return complain(exit_status(error.code), (ours ? at_hand() : std::string(prefix)) + error.message);
}

void set_at_hand(std::string what) { task = std::move(what); }
std::string at_hand() { return task.empty() ? "" : task + ": "; }

void warn(std::string_view message) {
  clear_progress();
  std::cerr << "bitr: warning: " << one_line(message) << '\n';
}

void show_progress(std::string_view text) {
  if (isatty(STDERR_FILENO) != 1) return;
  std::cerr << "\r\033[K" << text << std::flush;
  progress_shown = true;
}

void clear_progress() {
  if (progress_shown) std::cerr << "\r\033[K" << std::flush;
  progress_shown = false;
}

Result<void> check_output(std::string_view option, const std::string& path,
                          const std::vector<std::string>& inputs) {
  if (path.empty() || path == "-") return {};
  const auto refuse = [&](std::string_view why) {
    return fail(ErrorCode::invalid_argument, std::string(option) + " " + path + ": " + std::string(why));
  };
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (std::filesystem::is_directory(status)) return refuse("is a folder");
  if (std::filesystem::is_other(status)) {
    // Pipes and devices are written to where they are.
    if (access(path.c_str(), W_OK) != 0) return refuse("cannot be written to");
    return {};
  }
  std::filesystem::path folder = std::filesystem::path(path).parent_path();
  if (folder.empty()) folder = ".";
  if (!std::filesystem::is_directory(folder, error)) return refuse("its folder does not exist");
  if (access(folder.c_str(), W_OK | X_OK) != 0) return refuse("its folder cannot be written to");
  // What it leads to may be made meanwhile, by this command too, and it is not what was asked for.
  if (!std::filesystem::exists(status) &&
      std::filesystem::is_symlink(std::filesystem::symlink_status(path, error)))
    return refuse("is a symbolic link to nothing");
  InputFiles read;
  for (const std::string& input : inputs) read.add(input);
  if (read.has(path)) return refuse("would replace an input");
  return {};
}

Result<void> check_outputs(const std::vector<OutputFile>& files, const std::vector<std::string>& inputs) {
  for (auto file = files.begin(); file != files.end(); ++file) {
    if (file->path.empty()) continue;
    const auto refuse = [&](std::string_view why, std::string_view what, std::string_view rest) {
      return fail(ErrorCode::invalid_argument, std::string(file->option) + " " + file->path + ": " +
                                                   std::string(why) + std::string(what) + std::string(rest));
    };
    if (file->path == "-" && !file->what.empty()) return refuse("", file->what, " needs a file");
    if (auto checked = check_output(file->option, file->path, inputs); !checked) return checked;
    for (auto other = files.begin(); other != file; ++other)
      if (same_file(other->path, file->path)) return refuse("is the file of ", other->option, " too");
  }
  return {};
}

void InputFiles::add(const std::string& path) {
  struct stat status;
  if (::stat(path.c_str(), &status) == 0) files_.emplace(status.st_dev, status.st_ino);
}

bool InputFiles::has(const std::string& path) const {
  struct stat status;
  return ::stat(path.c_str(), &status) == 0 && S_ISREG(status.st_mode) &&
         files_.contains({status.st_dev, status.st_ino});
}

Result<void> make_folder(std::string_view option, const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) return {};
  // Making what is there already counts as a success, whatever it is.
  const std::string why = error ? error.message() : "there is something else of that name";
  return fail(ErrorCode::invalid_argument, std::string(option) + " " + path + ": cannot be made: " + why);
}

Bytes bytes_of(std::string_view text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

Result<void> write_files(const std::vector<FileWriter>& files) {
  io::StagedFiles staged;
  std::optional<Bytes> shown;
  for (const FileWriter& file : files) {
    if (file.path.empty()) continue;
    auto bytes = file.make(file.path);
    if (!bytes) return tl::unexpected(bytes.error());
    if (file.path == "-")
      shown = std::move(*bytes);
    else if (auto added = staged.add(file.path, *bytes); !added)
      return added;
  }
  if (shown &&
      !std::cout
           .write(reinterpret_cast<const char*>(shown->data()), static_cast<std::streamsize>(shown->size()))
           .flush())
    return fail(ErrorCode::io, "standard output cannot be written");
  return staged.commit();
}

FileWriter json_writer(const std::string& path, const Json& json) {
  if (path.empty()) return {};
  // Names of files need not be UTF-8; JSON must be.
  return {path, [text = json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n"](const std::string&) {
            return bytes_of(text);
          }};
}

Result<void> write_json(const std::string& path, const Json& json) {
  return write_files({json_writer(path, json)});
}

Json matrix_json(const Pose& pose) {
  const auto matrix = pose.matrix();
  Json rows = Json::array();
  for (int row = 0; row < 4; ++row)
    rows.push_back({matrix[4 * row], matrix[4 * row + 1], matrix[4 * row + 2], matrix[4 * row + 3]});
  return rows;
}

}  // namespace bitr::tool
