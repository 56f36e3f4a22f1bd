#include "output.hpp"

#include <unistd.h>

#include <bitr/io.hpp>
#include <iostream>

#include "command.hpp"

namespace bitr::tool {
namespace {

bool progress_shown = false;

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
  return complain(exit_status(error.code), std::string(prefix) + error.message);
}

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
  std::filesystem::path folder = std::filesystem::path(path).parent_path();
  if (folder.empty()) folder = ".";
  if (!std::filesystem::is_directory(folder, error)) return refuse("its folder does not exist");
  if (access(folder.c_str(), W_OK | X_OK) != 0) return refuse("its folder cannot be written to");
  if (std::filesystem::is_directory(path, error)) return refuse("is a folder");
  for (const std::string& input : inputs)
    if (std::filesystem::equivalent(path, input, error)) return refuse("would replace an input");
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

Result<void> write_files(const std::vector<FileWriter>& files) {
  for (auto file = files.begin(); file != files.end(); ++file) {
    if (file->path.empty()) continue;
    const auto written = file->write(file->path);
    if (written) continue;
    std::error_code ignored;
    for (auto made = files.begin(); made != file; ++made)
      if (std::filesystem::is_regular_file(made->path, ignored)) std::filesystem::remove(made->path, ignored);
    return written;
  }
  return {};
}

Result<void> write_json(const std::string& path, const Json& json) {
  // Names of files need not be UTF-8; JSON must be.
  const std::string text = json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
  if (path != "-") return io::write_file(path, std::as_bytes(std::span(text)));
  std::cout << text;
  return {};
}

Json matrix_json(const Pose& pose) {
  const auto matrix = pose.matrix();
  Json rows = Json::array();
  for (int row = 0; row < 4; ++row)
    rows.push_back({matrix[4 * row], matrix[4 * row + 1], matrix[4 * row + 2], matrix[4 * row + 3]});
  return rows;
}

}  // namespace bitr::tool
