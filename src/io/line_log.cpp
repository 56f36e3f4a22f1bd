#include "io/line_log.hpp"

#include <fcntl.h>
#include <sys/stat.h>

#include <string>
#include <vector>

#include "core/failure.hpp"

namespace bitr::io {
namespace {

[[noreturn]] void refuse(const std::filesystem::path& file, std::string_view what, int error) {
  const auto failed = refused(file, what, error);
  throw Failure(failed.value().code, failed.value().message);
}

[[noreturn]] void refuse(const std::filesystem::path& file, const char* why) {
  throw Failure(ErrorCode::io, label(file.native()) + ": " + why);
}

}  // namespace

LineLog::LineLog(std::filesystem::path file, const Keep& keep) : file_(std::move(file)) {
  open();
  read(keep);
  if (::ftruncate(descriptor_.get(), size_) != 0 || ::lseek(descriptor_.get(), size_, SEEK_SET) < 0)
    refuse(file_, "write", errno);
}

void LineLog::open() {
  struct stat status;
  if (::stat(file_.c_str(), &status) == 0 && !S_ISREG(status.st_mode))
    refuse(file_, "is no regular file, so that it cannot be gone on with");
  descriptor_ = Descriptor(::open(file_.c_str(), O_RDWR | O_CLOEXEC));
  if (descriptor_ || errno != ENOENT) {
    if (!descriptor_) refuse(file_, "open for writing", errno);
    return;
  }
  // O_EXCL follows no link.
  descriptor_ = Descriptor(::open(file_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666));
  if (descriptor_) return;
  const int error = errno;
  if (error == EEXIST && ::lstat(file_.c_str(), &status) == 0 && S_ISLNK(status.st_mode))
    refuse(file_, "is a symbolic link to nothing");
  refuse(file_, "open for writing", error);
}

void LineLog::read(const Keep& keep) {
  std::string rest;
  std::vector<char> block(1 << 16);
  for (;;) {
    const ssize_t got = ::read(descriptor_.get(), block.data(), block.size());
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) refuse(file_, "read", errno);
    if (got == 0) break;
    std::size_t searched = rest.size(), begin = 0;
    rest.append(block.data(), static_cast<std::size_t>(got));
    for (std::size_t end; (end = rest.find('\n', searched)) != std::string::npos;
         searched = begin = end + 1) {
      if (!keep(std::string_view(rest).substr(begin, end - begin), true)) return;
      size_ += static_cast<std::int64_t>(end - begin) + 1;
    }
    rest.erase(0, begin);
  }
  if (!rest.empty()) (void)keep(rest, false);
}

void LineLog::check_place() const {
  struct stat opened, there;
  if (::fstat(descriptor_.get(), &opened) != 0) refuse(file_, "write", errno);
  if (::stat(file_.c_str(), &there) != 0) refuse(file_, "write", errno);
  if (opened.st_dev != there.st_dev || opened.st_ino != there.st_ino)
    refuse(file_, "was replaced by another file while it was written");
}

void LineLog::append(std::string_view lines) {
  if (const int error = write_all(descriptor_.get(), std::as_bytes(std::span(lines)))) {
    // A half-written line would be cut off next time; other readers should not see it either.
    if (::ftruncate(descriptor_.get(), size_) == 0) (void)::lseek(descriptor_.get(), size_, SEEK_SET);
    refuse(file_, "write", error);
  }
  check_place();
  size_ += static_cast<std::int64_t>(lines.size());
}

}  // namespace bitr::io
