// Open files of the operating system, and what it said when it refused one.
#pragma once

#include <unistd.h>

#include <bitr/result.hpp>
#include <cerrno>
#include <cstddef>
#include <filesystem>
#include <span>
#include <system_error>
#include <utility>

#include "io/complaint.hpp"

namespace bitr::io {

class Descriptor {
 public:
  Descriptor() = default;
  explicit Descriptor(int number) : number_(number) {}
  Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }
  ~Descriptor() { close(); }

  explicit operator bool() const { return number_ >= 0; }
  int get() const { return number_; }
  bool close() {
    const int number = std::exchange(number_, -1);
    return number < 0 || ::close(number) == 0;
  }

 private:
  int number_ = -1;
};

/// `io`: "scan.ply: cannot write: No space left on device".
inline tl::unexpected<Error> refused(const std::filesystem::path& path, std::string_view action, int error) {
  return fail(ErrorCode::io, text(label(path.native()), ": cannot ", action, ": ",
                                  std::error_code(error, std::generic_category()).message()));
}

/// 0, or the errno of the write that failed.
inline int write_all(int descriptor, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return errno;
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
  return 0;
}

}  // namespace bitr::io
