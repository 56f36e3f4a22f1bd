// A text file that grows by whole lines and can be taken up again after its writer was killed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string_view>

namespace bitr::io {

class LineLog {
 public:
  /// Keeps the lines that are there, up to the first that `keep` refuses or that a killed process left
  /// unfinished; what follows is cut off. Makes the file where there is none. Failure (`io`).
  LineLog(std::filesystem::path file, const std::function<bool(std::string_view)>& keep);
  LineLog(const LineLog&) = delete;
  LineLog& operator=(const LineLog&) = delete;
  ~LineLog();

  /// `lines`: whole, each with its newline. All of them are in the file afterwards, or, with a Failure
  /// (`io`), none.
  void append(std::string_view lines);

 private:
  std::filesystem::path file_;
  int descriptor_ = -1;
  std::int64_t size_ = 0;
};

}  // namespace bitr::io
