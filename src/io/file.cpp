// Whole files, read into memory and written all or not at all.
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <bitr/io.hpp>
#include <cerrno>
#include <new>
#include <stdexcept>
#include <string>
#include <system_error>

#include "io/complaint.hpp"

namespace bitr::io {
namespace {

constexpr std::size_t max_file_bytes = std::size_t{1} << 33;
constexpr std::size_t chunk_bytes = std::size_t{1} << 20;

class Descriptor {
 public:
  explicit Descriptor(int number) : number_(number) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() { close(); }

  explicit operator bool() const { return number_ >= 0; }
  int get() const { return number_; }
  bool close() {
    const int number = std::exchange(number_, -1);
    return number < 0 || ::close(number) == 0;
  }

 private:
  int number_;
};

tl::unexpected<Error> refused(const std::filesystem::path& path, std::string_view action, int error) {
  return fail(ErrorCode::io, text(label(path.native()), ": cannot ", action, ": ",
                                  std::error_code(error, std::generic_category()).message()));
}

// 0, or the errno of the write that failed.
int write_all(int descriptor, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return errno;
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
  return 0;
}

// Some file systems cannot flush; a failed flush of one that can is a failed write.
int flush(int descriptor) {
  if (::fsync(descriptor) == 0 || errno == EINVAL || errno == ENOTSUP) return 0;
  return errno;
}

// Pipes, terminals and /dev/null have no name to rename over.
Result<void> write_in_place(const std::filesystem::path& path, std::span<const std::byte> bytes) {
  Descriptor descriptor(::open(path.c_str(), O_WRONLY | O_CLOEXEC));
  if (!descriptor) return refused(path, "open for writing", errno);
  if (const int error = write_all(descriptor.get(), bytes)) return refused(path, "write", error);
  if (!descriptor.close()) return refused(path, "write", errno);
  return {};
}

Result<void> write_and_rename(const std::filesystem::path& path, std::span<const std::byte> bytes,
                              const struct stat* existing) {
  // A short name of its own: the file's name may leave no room for a suffix.
  static std::atomic<unsigned> counter{0};
  std::filesystem::path temporary;
  int number = -1;
  do {
    temporary = path.parent_path() / text(".bitr-", ::getpid(), "-", counter++, ".tmp");
    number = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  } while (number < 0 && errno == EEXIST);
  Descriptor descriptor(number);
  if (!descriptor) return refused(path, "create a file beside it", errno);

  int error = write_all(descriptor.get(), bytes);
  if (!error && existing && ::fchmod(descriptor.get(), existing->st_mode & 07777) != 0) error = errno;
  if (!error) error = flush(descriptor.get());
  if (!descriptor.close() && !error) error = errno;
  if (!error && ::rename(temporary.c_str(), path.c_str()) != 0) error = errno;
  if (error) {
    ::unlink(temporary.c_str());
    return refused(path, "write", error);
  }
  return {};
}

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
  struct stat status;
  const bool exists = ::stat(path.c_str(), &status) == 0;
  if (exists && S_ISDIR(status.st_mode)) return refused(path, "write", EISDIR);
  if (exists && !S_ISREG(status.st_mode)) return write_in_place(path, bytes);
  // A symbolic link stays one: what it points to is replaced.
  std::error_code error;
  const std::filesystem::path target = exists ? std::filesystem::canonical(path, error) : path;
  if (error) return refused(path, "write", error.value());
  return write_and_rename(target, bytes, exists ? &status : nullptr);
}

}  // namespace bitr::io
