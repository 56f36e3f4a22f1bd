// Files spelled out in the tests: numbers as bytes, bytes as a parse.
#pragma once

#include <algorithm>
#include <bit>
#include <bitr/io.hpp>
#include <cstring>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace bitr::io {

/// By the names of their parsers.
inline const std::map<std::string, CloudFormat> formats = {
    {"ply", CloudFormat::ply}, {"pcd", CloudFormat::pcd}, {"text", CloudFormat::text},
    {"npy", CloudFormat::npy}, {"obj", CloudFormat::obj}, {"off", CloudFormat::off},
    {"stl", CloudFormat::stl}};
inline const std::vector<Vec3d> two_points = {{1, 2, 3}, {-4.5, 0.25, 1e3}};

/// The values' bytes one after the other, in the given byte order.
template <class... Values>
std::string raw(std::endian order, Values... values) {
  std::string out;
  const auto add = [&](auto value) {
    char bytes[sizeof value];
    std::memcpy(bytes, &value, sizeof value);
    if (order != std::endian::native) std::reverse(bytes, bytes + sizeof value);
    out.append(bytes, sizeof value);
  };
  (add(values), ...);
  return out;
}
template <class... Values>
std::string little(Values... values) {
  return raw(std::endian::little, values...);
}
template <class... Values>
std::string big(Values... values) {
  return raw(std::endian::big, values...);
}

inline Result<Geometry> parse(const std::string& content, CloudFormat format,
                              const ReadOptions& options = {}) {
  // An exact-size copy, so that AddressSanitizer sees a read past the end.
  const std::vector<char> exact(content.begin(), content.end());
  return parse_geometry(std::as_bytes(std::span(exact)), format, "scan.dat", options);
}
inline const ReadOptions strict = {.strict = true};

/// The error's text, or "" when there was none.
template <class T>
std::string message(const Result<T>& result) {
  return result ? "" : result.error().message;
}

}  // namespace bitr::io
