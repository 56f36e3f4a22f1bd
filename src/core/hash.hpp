// A number that changes with any byte: to tell files apart, not to guard them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace bitr {

inline constexpr std::uint64_t fnv1a_start = 14695981039346656037ull;

/// FNV-1a of the bytes so far, whose hash is `hash`, and these.
inline std::uint64_t fnv1a(std::span<const std::byte> bytes, std::uint64_t hash = fnv1a_start) {
  for (const std::byte b : bytes) hash = (hash ^ std::to_integer<std::uint64_t>(b)) * 1099511628211ull;
  return hash;
}

}  // namespace bitr
