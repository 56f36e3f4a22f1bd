// Whole files, read into memory and written all or not at all.
#include <fcntl.h>
#include <sys/stat.h>

#include <bitr/io.hpp>
#include <new>

#include "io/staged_files.hpp"

namespace bitr::io {
namespace {

constexpr std::size_t max_file_bytes = std::size_t{1} << 33;
constexpr std::size_t chunk_bytes = std::size_t{1} << 20;

Result<std::vector<std::byte>> read_all(const std::filesystem::path& path) {
  Descriptor descriptor(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!descriptor) return refused(path, "open", errno);
  struct stat status;
  if (::fstat(descriptor.get(), &status) != 0) return refused(path, "read", errno);
  const auto too_large = [&] {
    return fail(ErrorCode::io, text(label(path.native()), ": over ", max_file_bytes, " bytes, the limit"));
  };
  // Room for the size the system reports and one byte more, so that the read after it meets the end.
  std::vector<std::byte> bytes;
  if (S_ISREG(status.st_mode)) {
    if (static_cast<std::uint64_t>(status.st_size) > max_file_bytes) return too_large();
    bytes.resize(static_cast<std::size_t>(status.st_size) + 1);
  }
  std::size_t size = 0;
  for (;;) {
    if (size == bytes.size()) bytes.resize(size + std::max(chunk_bytes, size / 2));
    const ssize_t got = ::read(descriptor.get(), bytes.data() + size, bytes.size() - size);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return refused(path, "read", errno);
    if (got == 0) break;
    size += static_cast<std::size_t>(got);
    if (size > max_file_bytes) return too_large();
  }
  bytes.resize(size);
  return bytes;
}

}  // namespace

Result<std::vector<std::byte>> read_file(const std::filesystem::path& path) try {
  return read_all(path);
} catch (const std::bad_alloc&) {
  return fail(ErrorCode::io, text(label(path.native()), ": too large for this machine's memory"));
}

Result<void> write_file(const std::filesystem::path& path, std::span<const std::byte> bytes) {
  StagedFiles file;
  if (auto added = file.add(path, bytes); !added) return added;
  return file.commit();
}

}  // namespace bitr::io
