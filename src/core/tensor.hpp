// Named arrays as files carry them: a type, a shape and raw little-endian bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace bitr {

enum class DType : std::uint8_t { f16, bf16, f32, f64, i8, u8, i16, i32, i64, boolean };

/// Bytes per element.
std::size_t size_of(DType type);
/// The safetensors spelling: "F32", "I64", "BF16", …
std::string_view name(DType type);

struct Tensor {
  DType type = DType::f32;
  std::vector<std::size_t> shape;  ///< empty for a scalar
  std::vector<std::byte> bytes;    ///< row-major, little-endian; size() · size_of(type) of them

  std::size_t size() const;  ///< product of the shape
  /// Every element widened to double, in row-major order.
  std::vector<double> to_double() const;

  static Tensor from(std::vector<std::size_t> shape, const std::vector<float>& values);
  static Tensor from(std::vector<std::size_t> shape, const std::vector<double>& values);
  static Tensor from(std::vector<std::size_t> shape, const std::vector<std::int64_t>& values);
  /// In 16 bits, each the nearest to its value (ties to even); infinite from 65520 on.
  static Tensor half(std::vector<std::size_t> shape, const std::vector<float>& values);
};

/// Tensors by name, with the file's free-form metadata.
struct TensorMap {
  std::map<std::string, Tensor> tensors;
  std::map<std::string, std::string> metadata;
};

}  // namespace bitr
