// Entries of a zip archive in memory: stored or deflated, never encrypted, and never more than the file can
// account for.
#pragma once

#include <bitr/result.hpp>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

struct zip;

namespace bitr::io {

class ZipArchive {
 public:
  /// Reads the directory; `bytes` must outlive the archive. Errors name the entry, the caller knows the file.
  static Result<ZipArchive> open(std::span<const std::byte> bytes);

  /// Paths in the directory's order.
  std::vector<std::string> paths() const;
  bool contains(const std::string& path) const;

  /// An entry's bytes, checked against its CRC-32. `bad_file` when it is absent, encrypted, compressed by
  /// anything but deflate or damaged, and when all that was ever read would pass 16 times the file's size
  /// plus 1 MiB.
  Result<std::vector<std::byte>> read(const std::string& path);

 private:
  struct Close {
    void operator()(zip* archive) const;
  };

  std::unique_ptr<zip, Close> archive_;
  std::uint64_t budget_ = 0;
};

}  // namespace bitr::io
