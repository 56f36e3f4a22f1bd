// Files that appear together or not at all.
#pragma once

#include <sys/stat.h>

#include <bitr/result.hpp>
#include <cstddef>
#include <filesystem>
#include <span>
#include <vector>

#include "io/descriptor.hpp"

namespace bitr::io {

/// Each is written to a temporary beside its place and flushed; commit() renames them all. What goes before
/// that leaves every older file as it is, and so does a commit() that fails, where the file system has hard
/// links.
///
/// A file that is replaced keeps its permissions and its owner as far as they can be given; a symbolic link
/// stays one and has what it leads to replaced, but a link to nothing is refused. Pipes and devices have no
/// name to rename over: commit() writes to them before it renames anything. The first use of a folder also
/// removes the temporaries in it that nobody is writing any more; those of a living process are locked.
class StagedFiles {
 public:
  StagedFiles() = default;
  StagedFiles(const StagedFiles&) = delete;
  StagedFiles& operator=(const StagedFiles&) = delete;
  ~StagedFiles();

  /// `io` when it cannot be written there.
  Result<void> add(const std::filesystem::path& path, std::span<const std::byte> bytes);
  /// `io` when one of them cannot take its place: none has then.
  Result<void> commit();

 private:
  struct Staged {
    std::filesystem::path path, target, temporary;
    std::filesystem::path older;  ///< another name of what is replaced, while it may have to come back
    Descriptor lock;
    bool replaces = false, in_place = false;
  };
  struct Stream {
    std::filesystem::path path;
    std::vector<std::byte> bytes;
  };

  Result<void> stage(Staged& file, std::span<const std::byte> bytes, const struct ::stat* replaced);
  void keep_older();
  void take_back();

  std::vector<Staged> files_;
  std::vector<Stream> streams_;
};

}  // namespace bitr::io
