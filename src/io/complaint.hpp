// Error messages of the parsers: "scan.ply: byte 212: what is wrong, and the limit", always one line.
#pragma once

#include <charconv>
#include <concepts>
#include <cstdint>
#include <limits>
#include <string>

#include "io/formats.hpp"
#include "io/quote.hpp"

namespace bitr::io {

/// Where in a file something is wrong: a byte offset from 0, or a line from 1.
struct Place {
  enum class Unit : std::uint8_t { byte, line } unit = Unit::byte;
  std::size_t at = 0;

  static Place byte(std::size_t offset) { return {Unit::byte, offset}; }
  static Place line(std::size_t number) { return {Unit::line, number}; }
};

inline void append(std::string& out, std::string_view part) { out += part; }
inline void append(std::string& out, std::integral auto part) { out += std::to_string(part); }
inline void append(std::string& out, double part) {
  char digits[32];
  out.append(digits, std::to_chars(digits, digits + sizeof digits, part).ptr);
}

/// The parts one after the other, numbers in decimal.
template <class... Parts>
std::string text(const Parts&... parts) {
  std::string out;
  (append(out, parts), ...);
  return out;
}

/// A file name as it may appear in a message: without control characters.
inline std::string label(std::string_view name) {
  std::string out(name);
  for (char& c : out) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  }
  return out;
}

template <class... Parts>
tl::unexpected<Error> refuse(ErrorCode code, const File& file, const Parts&... parts) {
  return fail(code, text(label(file.name), ": ", parts...));
}

/// `bad_file` at a place.
template <class... Parts>
tl::unexpected<Error> bad(const File& file, Place place, const Parts&... parts) {
  const std::string_view unit = place.unit == Place::Unit::byte ? "byte " : "line ";
  return refuse(ErrorCode::bad_file, file, unit, place.at, ": ", parts...);
}

/// `count · each` for a message, where the product may not fit 64 bits.
inline std::string product(std::uint64_t count, std::uint64_t each) {
  if (each != 0 && count > std::numeric_limits<std::uint64_t>::max() / each) return "over 2^64";
  return text(count * each);
}

}  // namespace bitr::io
