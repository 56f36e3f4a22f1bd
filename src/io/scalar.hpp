// The number types of binary cloud files, at any alignment and in either byte order.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace bitr::io {

enum class ScalarType : std::uint8_t { i8, u8, i16, u16, i32, u32, i64, u64, f32, f64 };

inline std::size_t size_of(ScalarType type) {
  constexpr std::uint8_t sizes[] = {1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
  return sizes[static_cast<int>(type)];
}
inline bool is_float(ScalarType type) { return type == ScalarType::f32 || type == ScalarType::f64; }

template <class T>
T load(const std::byte* at, std::endian order = std::endian::little) {
  std::array<std::byte, sizeof(T)> raw;
  std::memcpy(raw.data(), at, sizeof(T));
  if (order != std::endian::native) {
    for (std::size_t i = 0; i < sizeof(T) / 2; ++i) {
      const std::byte swapped = raw[i];
      raw[i] = raw[sizeof(T) - 1 - i];
      raw[sizeof(T) - 1 - i] = swapped;
    }
  }
  return std::bit_cast<T>(raw);
}

/// The number at `at`, converted to `To`. 64-bit integers lose digits past 2^53 when `To` is double.
template <class To>
To load_as(ScalarType type, const std::byte* at, std::endian order = std::endian::little) {
  switch (type) {
    case ScalarType::i8:
      return static_cast<To>(load<std::int8_t>(at, order));
    case ScalarType::u8:
      return static_cast<To>(load<std::uint8_t>(at, order));
    case ScalarType::i16:
      return static_cast<To>(load<std::int16_t>(at, order));
    case ScalarType::u16:
      return static_cast<To>(load<std::uint16_t>(at, order));
    case ScalarType::i32:
      return static_cast<To>(load<std::int32_t>(at, order));
    case ScalarType::u32:
      return static_cast<To>(load<std::uint32_t>(at, order));
    case ScalarType::i64:
      return static_cast<To>(load<std::int64_t>(at, order));
    case ScalarType::u64:
      return static_cast<To>(load<std::uint64_t>(at, order));
    case ScalarType::f32:
      return static_cast<To>(load<float>(at, order));
    case ScalarType::f64:
      return static_cast<To>(load<double>(at, order));
  }
  return To{};
}

}  // namespace bitr::io
