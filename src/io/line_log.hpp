// A text file that grows by whole lines and can be taken up again after its writer was killed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string_view>

#include "io/descriptor.hpp"

namespace bitr::io {

class LineLog {
 public:
  /// Whether to keep a line and go on with the next. `whole`: false for what stands behind the last newline,
  /// which is never kept. May throw a Failure, and then the file stays as it is.
  using Keep = std::function<bool(std::string_view line, bool whole)>;

  /// Keeps the lines that are there, up to the first that `keep` refuses or that a killed process left
  /// unfinished; what follows is cut off. Makes the file where there is none, but not at the end of a
  /// symbolic link. Failure (`io`).
  LineLog(std::filesystem::path file, const Keep& keep);

  /// `lines`: whole, each with its newline. All of them are in the file afterwards, or, with a Failure
  /// (`io`), none; that too when the file is not there any more.
  void append(std::string_view lines);

 private:
  void open();
  void read(const Keep& keep);
  void check_place() const;

  std::filesystem::path file_;
  Descriptor descriptor_;
  std::int64_t size_ = 0;
};

}  // namespace bitr::io
