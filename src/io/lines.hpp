// Text files, line by line and word by word, without copies and without the locale.
#pragma once

#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string_view>

namespace bitr::io {

inline bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\f' || c == '\v'; }

/// Hands out the lines of a text; "\n" ends a line, "\r\n" too since a "\r" counts as a blank.
class Lines {
 public:
  explicit Lines(std::string_view text, std::size_t lines_before = 0) : text_(text), number_(lines_before) {}

  /// False at the end of the text.
  bool next(std::string_view& line) {
    if (at_ >= text_.size()) return false;
    const auto* end = static_cast<const char*>(std::memchr(text_.data() + at_, '\n', text_.size() - at_));
    const std::size_t length = end ? static_cast<std::size_t>(end - text_.data()) - at_ : text_.size() - at_;
    line = text_.substr(at_, length);
    at_ += length + 1;
    ++number_;
    return true;
  }
  /// The next line with a word on it.
  bool next_filled(std::string_view& line) {
    while (next(line)) {
      for (const char c : line) {
        if (!is_blank(c)) return true;
      }
    }
    return false;
  }
  /// Number of the line handed out last, from 1.
  std::size_t number() const { return number_; }
  /// Bytes of the text not handed out yet.
  std::size_t remaining() const { return at_ < text_.size() ? text_.size() - at_ : 0; }
  /// Offset of the first byte not handed out yet.
  std::size_t offset() const { return at_ < text_.size() ? at_ : text_.size(); }

 private:
  std::string_view text_;
  std::size_t at_ = 0, number_;
};

/// Hands out the words of a line, separated by blanks.
class Words {
 public:
  explicit Words(std::string_view line) : at_(line.data()), end_(line.data() + line.size()) {}

  /// Empty at the end of the line.
  std::string_view next() {
    while (at_ != end_ && is_blank(*at_)) ++at_;
    const char* begin = at_;
    while (at_ != end_ && !is_blank(*at_)) ++at_;
    return {begin, static_cast<std::size_t>(at_ - begin)};
  }

 private:
  const char *at_, *end_;
};

/// Reads a whole word as a number. True for NaN and infinity as well.
inline bool parse_number(std::string_view word, double& value) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  const char* end = word.data() + word.size();
  const auto [stop, error] = std::from_chars(word.data(), end, value);
  if (stop != end || word.empty()) return false;
  if (error == std::errc{}) return true;
  // Out of a double's range, either way: the wider type tells 1e-400, which is 0, from 1e400, which is
  // refused.
  long double wide = 0;
  if (std::from_chars(word.data(), end, wide).ec != std::errc{}) return false;
  value = static_cast<double>(wide);
  return std::isfinite(value);
}

/// Reads a whole word as an integer.
template <class Integer>
bool parse_integer(std::string_view word, Integer& value) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  const char* end = word.data() + word.size();
  const auto [stop, error] = std::from_chars(word.data(), end, value);
  return stop == end && error == std::errc{};
}

}  // namespace bitr::io
