#include "io/staged_files.hpp"

#include <fcntl.h>
#include <sys/file.h>

#include <algorithm>
#include <atomic>
#include <mutex>
#include <set>
#include <string>
#include <string_view>

namespace bitr::io {
namespace {

constexpr std::string_view prefix = ".bitr-", suffix = ".tmp";

/// A short name of its own: the file's name may leave no room for a suffix.
std::filesystem::path name_in(const std::filesystem::path& folder) {
  static std::atomic<unsigned> counter{0};
  return folder / text(prefix, ::getpid(), "-", counter++, suffix);
}

bool is_temporary(std::string_view name) {
  if (!name.starts_with(prefix) || !name.ends_with(suffix) || name.size() <= prefix.size() + suffix.size())
    return false;
  name.remove_prefix(prefix.size());
  name.remove_suffix(suffix.size());
  return name.find_first_not_of("0123456789-") == std::string_view::npos;
}

/// Whoever writes one holds its lock.
void remove_orphan(const std::filesystem::path& path) {
  const Descriptor file(::open(path.c_str(), O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  struct stat status;
  if (!file || ::fstat(file.get(), &status) != 0 || !S_ISREG(status.st_mode)) return;
  if (::flock(file.get(), LOCK_EX | LOCK_NB) == 0) ::unlink(path.c_str());
}

/// Once for every folder: to look through one takes long when it is large.
void remove_orphans(const std::filesystem::path& folder) {
  static std::mutex mutex;
  static std::set<std::filesystem::path> seen;
  {
    const std::lock_guard lock(mutex);
    if (!seen.insert(folder).second) return;
  }
  std::error_code error;
  std::filesystem::directory_iterator entry(folder, error), end;
  for (; !error && entry != end; entry.increment(error))
    if (is_temporary(entry->path().filename().native())) remove_orphan(entry->path());
}

/// False when somebody who takes it for an orphan was faster.
bool lock_new_file(int descriptor) {
  if (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) return errno != EWOULDBLOCK;
  struct stat status;
  return ::fstat(descriptor, &status) != 0 || status.st_nlink > 0;
}

// Some file systems cannot flush; a failed flush of one that can is a failed write.
int flush(int descriptor) {
  if (::fsync(descriptor) == 0 || errno == EINVAL || errno == ENOTSUP) return 0;
  return errno;
}

int take_over_permissions(int descriptor, const struct stat& from) {
  // Only root may give files away; the group can be kept where it is one of one's own.
  if (::fchown(descriptor, from.st_uid, from.st_gid) != 0 &&
      ::fchown(descriptor, static_cast<uid_t>(-1), from.st_gid) != 0) {
    // It stays the writer's.
  }
  return ::fchmod(descriptor, from.st_mode & 07777) == 0 ? 0 : errno;
}

Result<void> write_in_place(const std::filesystem::path& path, std::span<const std::byte> bytes) {
  Descriptor descriptor(::open(path.c_str(), O_WRONLY | O_CLOEXEC));
  if (!descriptor) return refused(path, "open for writing", errno);
  if (const int error = write_all(descriptor.get(), bytes)) return refused(path, "write", error);
  if (!descriptor.close()) return refused(path, "write", errno);
  return {};
}

}  // namespace

StagedFiles::~StagedFiles() { take_back(); }

Result<void> StagedFiles::add(const std::filesystem::path& path, std::span<const std::byte> bytes) {
  struct stat status;
  const bool exists = ::stat(path.c_str(), &status) == 0;
  if (!exists) {
    const int error = errno;
    struct stat link;
    if (::lstat(path.c_str(), &link) == 0) {
      if (error != ENOENT) return refused(path, "write", error);
      return fail(ErrorCode::io, text(label(path.native()), ": cannot write: is a symbolic link to nothing"));
    }
  } else if (S_ISDIR(status.st_mode)) {
    return refused(path, "write", EISDIR);
  } else if (!S_ISREG(status.st_mode)) {
    streams_.push_back({path, {bytes.begin(), bytes.end()}});
    return {};
  }
  std::error_code error;
  Staged file;
  file.path = path;
  file.target = exists ? std::filesystem::canonical(path, error) : path;
  if (error) return refused(path, "write", error.value());
  file.replaces = exists;
  // Known before it is made, so that it is taken back whatever happens.
  files_.push_back(std::move(file));
  auto staged = stage(files_.back(), bytes, exists ? &status : nullptr);
  if (!staged) {
    if (!files_.back().temporary.empty()) ::unlink(files_.back().temporary.c_str());
    files_.pop_back();
  }
  return staged;
}

Result<void> StagedFiles::stage(Staged& file, std::span<const std::byte> bytes, const struct stat* replaced) {
  const std::filesystem::path folder = file.target.parent_path();
  remove_orphans(folder.empty() ? "." : folder);
  for (bool locked = false; !locked;) {
    const std::filesystem::path name = name_in(folder);
    // Nobody may read meanwhile what only some may read in the end.
    file.lock = Descriptor(
        ::open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, replaced ? S_IRUSR | S_IWUSR : 0666));
    if (!file.lock && errno == EEXIST) continue;
    if (!file.lock) return refused(file.path, "create a file beside it", errno);
    file.temporary = name;
    locked = lock_new_file(file.lock.get());
  }
  int error = write_all(file.lock.get(), bytes);
  if (!error && replaced) error = take_over_permissions(file.lock.get(), *replaced);
  if (!error) error = flush(file.lock.get());
  if (error) return refused(file.path, "write", error);
  return {};
}

void StagedFiles::keep_older() {
  // A single rename replaces or it does not.
  if (files_.size() < 2) return;
  for (Staged& file : files_) {
    if (!file.replaces) continue;
    const std::filesystem::path name = name_in(file.target.parent_path());
    if (::link(file.target.c_str(), name.c_str()) == 0) file.older = name;
  }
}

void StagedFiles::take_back() {
  for (Staged& file : files_) {
    if (!file.in_place)
      ::unlink(file.temporary.c_str());
    else if (!file.replaces)
      ::unlink(file.target.c_str());
    else if (!file.older.empty() && ::rename(file.older.c_str(), file.target.c_str()) == 0)
      continue;
    if (!file.older.empty()) ::unlink(file.older.c_str());
  }
  files_.clear();
}

Result<void> StagedFiles::commit() {
  for (const Stream& stream : streams_)
    if (auto written = write_in_place(stream.path, stream.bytes); !written) return written;
  streams_.clear();
  keep_older();
  for (Staged& file : files_) {
    if (::rename(file.temporary.c_str(), file.target.c_str()) != 0) {
      const int error = errno;
      const std::filesystem::path path = file.path;
      take_back();
      return refused(path, "write", error);
    }
    file.in_place = true;
  }
  for (const Staged& file : files_)
    if (!file.older.empty()) ::unlink(file.older.c_str());
  files_.clear();
  return {};
}

}  // namespace bitr::io
