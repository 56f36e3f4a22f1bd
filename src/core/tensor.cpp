#include "core/tensor.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <functional>
#include <numeric>

namespace bitr {
namespace {

template <class T>
Tensor make(DType type, std::vector<std::size_t> shape, const std::vector<T>& values) {
  Tensor tensor{type, std::move(shape), std::vector<std::byte>(values.size() * sizeof(T))};
  if (!values.empty()) std::memcpy(tensor.bytes.data(), values.data(), tensor.bytes.size());
  return tensor;
}

template <class T>
T load(const std::byte* at) {
  T value;
  std::memcpy(&value, at, sizeof value);
  return value;
}

double widen_f16(std::uint16_t bits) {
  const int exponent = (bits >> 10) & 31;
  const int mantissa = bits & 1023;
  const double sign = bits & 0x8000 ? -1 : 1;
  if (exponent == 0) return sign * std::ldexp(mantissa, -24);
  if (exponent == 31) return mantissa ? std::nan("") : sign * INFINITY;
  return sign * std::ldexp(1024 + mantissa, exponent - 25);
}

std::uint16_t narrow_f16(float value) {
  const std::uint32_t sign = std::signbit(value) ? 0x8000 : 0;
  const double size = std::abs(static_cast<double>(value));
  int exponent = 0;
  std::frexp(size, &exponent);  // below 2^exponent
  std::uint32_t bits = 0x7c00;
  if (std::isnan(value))
    bits = 0x7e00;
  else if (size < 0x1p-14)
    bits = static_cast<std::uint32_t>(std::nearbyint(std::ldexp(size, 24)));
  else if (size < 65520)  // rounding up to the next power of two carries into the exponent
    bits = (static_cast<std::uint32_t>(exponent + 13) << 10) +
           static_cast<std::uint32_t>(std::nearbyint(std::ldexp(size, 11 - exponent)));
  return static_cast<std::uint16_t>(sign | bits);
}

double element(DType type, const std::byte* at) {
  switch (type) {
    case DType::f16:
      return widen_f16(load<std::uint16_t>(at));
    case DType::bf16:
      return std::bit_cast<float>(std::uint32_t{load<std::uint16_t>(at)} << 16);
    case DType::f32:
      return load<float>(at);
    case DType::f64:
      return load<double>(at);
    case DType::i8:
      return load<std::int8_t>(at);
    case DType::u8:
    case DType::boolean:
      return load<std::uint8_t>(at);
    case DType::i16:
      return load<std::int16_t>(at);
    case DType::i32:
      return load<std::int32_t>(at);
    case DType::i64:
      return static_cast<double>(load<std::int64_t>(at));
  }
  return 0;
}

}  // namespace

std::size_t size_of(DType type) {
  switch (type) {
    case DType::i8:
    case DType::u8:
    case DType::boolean:
      return 1;
    case DType::f16:
    case DType::bf16:
    case DType::i16:
      return 2;
    case DType::f32:
    case DType::i32:
      return 4;
    case DType::f64:
    case DType::i64:
      return 8;
  }
  return 0;
}

std::string_view name(DType type) {
  switch (type) {
    case DType::f16:
      return "F16";
    case DType::bf16:
      return "BF16";
    case DType::f32:
      return "F32";
    case DType::f64:
      return "F64";
    case DType::i8:
      return "I8";
    case DType::u8:
      return "U8";
    case DType::i16:
      return "I16";
    case DType::i32:
      return "I32";
    case DType::i64:
      return "I64";
    case DType::boolean:
      return "BOOL";
  }
  return "";
}

std::size_t Tensor::size() const {
  return std::accumulate(shape.begin(), shape.end(), std::size_t{1}, std::multiplies<>());
}

std::vector<double> Tensor::to_double() const {
  std::vector<double> values(size());
  const std::size_t width = size_of(type);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = element(type, bytes.data() + i * width);
  return values;
}

Tensor Tensor::from(std::vector<std::size_t> shape, const std::vector<float>& values) {
  return make(DType::f32, std::move(shape), values);
}
Tensor Tensor::from(std::vector<std::size_t> shape, const std::vector<double>& values) {
  return make(DType::f64, std::move(shape), values);
}
Tensor Tensor::from(std::vector<std::size_t> shape, const std::vector<std::int64_t>& values) {
  return make(DType::i64, std::move(shape), values);
}
Tensor Tensor::half(std::vector<std::size_t> shape, const std::vector<float>& values) {
  std::vector<std::uint16_t> narrow(values.size());
  std::transform(values.begin(), values.end(), narrow.begin(), narrow_f16);
  return make(DType::f16, std::move(shape), narrow);
}

}  // namespace bitr
