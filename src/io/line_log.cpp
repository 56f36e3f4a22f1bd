#include "io/line_log.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <fstream>
#include <string>
#include <system_error>

#include "core/failure.hpp"

namespace bitr::io {
namespace {

[[noreturn]] void refuse(const std::filesystem::path& file, const char* what, int error) {
  throw Failure(ErrorCode::io, file.string() + ": cannot " + what + ": " +
                                   std::error_code(error, std::generic_category()).message());
}

}  // namespace

LineLog::LineLog(std::filesystem::path file, const std::function<bool(std::string_view)>& keep)
    : file_(std::move(file)) {
  std::ifstream in(file_, std::ios::binary);
  for (std::string line; std::getline(in, line) && !in.eof() && keep(line);)
    size_ += static_cast<std::int64_t>(line.size()) + 1;
  in.close();
  descriptor_ = ::open(file_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0666);
  if (descriptor_ < 0) refuse(file_, "open for writing", errno);
  if (::ftruncate(descriptor_, size_) != 0 || ::lseek(descriptor_, size_, SEEK_SET) < 0) {
    const int error = errno;
    ::close(descriptor_);
    refuse(file_, "write", error);
  }
}

LineLog::~LineLog() { ::close(descriptor_); }

void LineLog::append(std::string_view lines) {
  for (std::string_view rest = lines; !rest.empty();) {
    const ssize_t written = ::write(descriptor_, rest.data(), rest.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) {
      const int error = errno;
      // A half-written line would be cut off next time; other readers should not see it either.
      if (::ftruncate(descriptor_, size_) == 0) (void)::lseek(descriptor_, size_, SEEK_SET);
      refuse(file_, "write", error);
    }
    rest.remove_prefix(static_cast<std::size_t>(written));
  }
  size_ += static_cast<std::int64_t>(lines.size());
}

}  // namespace bitr::io
