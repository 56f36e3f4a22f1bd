#include "io/safetensors.hpp"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "io/quote.hpp"

namespace bitr::io {
namespace {

using Json = nlohmann::json;

constexpr std::size_t length_bytes = 8;  // the header's length, as a little-endian u64
constexpr std::uint64_t header_limit = 100'000'000;
constexpr std::string_view metadata_key = "__metadata__";

std::optional<DType> dtype_named(std::string_view text) {
  for (const DType type : {DType::f16, DType::bf16, DType::f32, DType::f64, DType::i8, DType::u8, DType::i16,
                           DType::i32, DType::i64, DType::boolean}) {
    if (text == name(type)) return type;
  }
  return std::nullopt;
}

struct Entry {
  std::string name;
  std::optional<DType> type;
  bool has_shape = false;  // an empty shape is a scalar
  std::vector<std::uint64_t> shape;
  std::vector<std::uint64_t> offsets;  // begin, end
};

/// Reads the header event by event: no document is built, so memory and nesting stay within what is expected.
class HeaderReader final : public nlohmann::json_sax<Json> {
 public:
  std::vector<Entry> entries;
  std::map<std::string, std::string> metadata;
  std::string problem;

  bool start_object(std::size_t) override {
    if (state_ == State::start) return go(State::file);
    if (state_ != State::file) return unexpected("an object");
    return go(key_ == metadata_key ? State::metadata : State::tensor);
  }

  bool end_object() override {
    if (state_ != State::tensor) return go(state_ == State::metadata ? State::file : State::done);
    const Entry& entry = entries.back();
    for (const auto& [present, field] :
         {std::pair{entry.type.has_value(), "dtype"}, std::pair{entry.has_shape, "shape"},
          std::pair{!entry.offsets.empty(), "data_offsets"}}) {
      if (!present) return reject("tensor " + in_quotes(entry.name) + ": " + field + " is missing");
    }
    return go(State::file);
  }

  bool key(string_t& text) override {
    key_ = text;
    if (state_ == State::tensor) return true;
    if (state_ == State::metadata) {
      return !metadata.contains(text) || reject("metadata key " + in_quotes(text) + " appears twice");
    }
    if (!names_.insert(text).second) return reject("tensor " + in_quotes(text) + " appears twice");
    if (text != metadata_key) entries.push_back({.name = text, .type = {}, .shape = {}, .offsets = {}});
    return true;
  }

  bool string(string_t& text) override {
    if (state_ == State::metadata) {
      metadata.emplace(key_, text);
      return true;
    }
    if (state_ != State::tensor || key_ != "dtype") return unexpected("a string");
    Entry& entry = entries.back();
    if (entry.type) return twice();
    entry.type = dtype_named(text);
    return entry.type || reject("tensor " + in_quotes(entry.name) + ": unknown dtype " + in_quotes(text));
  }

  bool start_array(std::size_t) override {
    if (state_ != State::tensor || (key_ != "shape" && key_ != "data_offsets")) return unexpected("an array");
    Entry& entry = entries.back();
    numbers_ = key_ == "shape" ? &entry.shape : &entry.offsets;
    if (numbers_ == &entry.shape ? std::exchange(entry.has_shape, true) : !numbers_->empty()) return twice();
    return go(State::numbers);
  }

  bool end_array() override {
    if (key_ == "data_offsets" && numbers_->size() != 2) {
      return reject("tensor " + in_quotes(entries.back().name) + ": data_offsets has " +
                    std::to_string(numbers_->size()) + " numbers, not 2");
    }
    return go(State::tensor);
  }

  bool number_unsigned(number_unsigned_t value) override {
    if (state_ != State::numbers) return unexpected("a number");
    numbers_->push_back(value);
    return true;
  }

  bool null() override { return unexpected("null"); }
  bool boolean(bool) override { return unexpected("a boolean"); }
  bool number_integer(number_integer_t) override { return unexpected("a negative number"); }
  bool number_float(number_float_t, const string_t&) override { return unexpected("a fraction"); }
  bool binary(binary_t&) override { return unexpected("binary"); }

  bool parse_error(std::size_t position, const std::string&, const nlohmann::detail::exception&) override {
    return reject("byte " + std::to_string(length_bytes + (position ? position - 1 : 0)) +
                  ": the header is not valid JSON");
  }

 private:
  enum class State { start, file, tensor, numbers, metadata, done };

  bool go(State next) {
    state_ = next;
    return true;
  }

  bool reject(std::string why) {
    problem = std::move(why);
    return false;
  }

  bool twice() { return reject("tensor " + in_quotes(entries.back().name) + ": " + key_ + " appears twice"); }

  bool unexpected(std::string_view what) {
    const std::string found = " holds " + std::string(what);
    switch (state_) {
      case State::start:
      case State::done:
        return reject("the header" + found + ", not an object");
      case State::file:
        return reject(in_quotes(key_) + found + ", not an object");
      case State::metadata:
        return reject("metadata " + in_quotes(key_) + found + ", not a string");
      case State::tensor:
      case State::numbers:
        break;
    }
    return reject("tensor " + in_quotes(entries.back().name) + ": " + in_quotes(key_) + found);
  }

  State state_ = State::start;
  std::string key_;
  std::set<std::string> names_;
  std::vector<std::uint64_t>* numbers_ = nullptr;
};

/// Bytes of a tensor of this shape, or nothing when the product overflows.
std::optional<std::uint64_t> bytes_of(const Entry& entry) {
  std::uint64_t total = 1;
  for (const std::uint64_t extent : entry.shape) {
    if (__builtin_mul_overflow(total, extent, &total)) return std::nullopt;
  }
  if (__builtin_mul_overflow(total, size_of(*entry.type), &total)) return std::nullopt;
  return total;
}

/// Why this entry's bytes can not be `data[expected, …)`; empty when they can.
std::string check(const Entry& entry, std::uint64_t expected, std::size_t available) {
  const std::uint64_t begin = entry.offsets[0];
  const std::uint64_t end = entry.offsets[1];
  const std::string at = "tensor " + in_quotes(entry.name) + ": data_offsets [" + std::to_string(begin) +
                         ", " + std::to_string(end) + "]";
  if (begin > end) return at + " run backwards";
  if (end > available) return at + " run past the buffer's " + std::to_string(available) + " bytes";
  if (begin < expected) return at + " overlap the bytes before " + std::to_string(expected);
  if (begin > expected) return at + " leave a hole from " + std::to_string(expected);
  const auto bytes = bytes_of(entry);
  if (!bytes) return "tensor " + in_quotes(entry.name) + ": the product of its shape overflows 64 bits";
  if (*bytes != end - begin) {
    return at + " hold " + std::to_string(end - begin) + " bytes, its shape and dtype need " +
           std::to_string(*bytes);
  }
  return {};
}

/// The header's length, once it is known to fit in the file.
Result<std::size_t> header_size(std::span<const std::byte> bytes, const std::string& file) {
  if (bytes.size() < length_bytes) {
    return fail(ErrorCode::bad_file, file + "byte 0: the file has " + std::to_string(bytes.size()) +
                                         " bytes, its header's length needs 8");
  }
  std::uint64_t size = 0;
  for (std::size_t i = 0; i < length_bytes; ++i) size |= std::to_integer<std::uint64_t>(bytes[i]) << 8 * i;
  const std::uint64_t limit = std::min<std::uint64_t>(header_limit, bytes.size() - length_bytes);
  if (size > limit) {
    return fail(ErrorCode::bad_file, file + "byte 0: header of " + std::to_string(size) + " bytes, limit " +
                                         std::to_string(limit));
  }
  return static_cast<std::size_t>(size);
}

std::string escaped(const std::string& text) {
  return Json(text).dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace

Result<TensorMap> parse_safetensors(std::span<const std::byte> bytes, std::string_view name) {
  const std::string file = std::string(name) + ": ";
  const auto size = header_size(bytes, file);
  if (!size) return tl::unexpected(size.error());
  const auto header = bytes.subspan(length_bytes, *size);
  const auto data = bytes.subspan(length_bytes + *size);
  // JSON would also allow blanks and a byte order mark in front; the format does not.
  if (header.empty() || header[0] != std::byte{'{'}) {
    return fail(ErrorCode::bad_file, file + "byte 8: the header does not start with '{'");
  }

  HeaderReader reader;
  const auto* text = reinterpret_cast<const char*>(header.data());
  if (!Json::sax_parse(text, text + header.size(), &reader))
    return fail(ErrorCode::bad_file, file + reader.problem);

  std::sort(reader.entries.begin(), reader.entries.end(),
            [](const Entry& a, const Entry& b) { return a.offsets < b.offsets; });
  TensorMap map;
  map.metadata = std::move(reader.metadata);
  std::uint64_t expected = 0;
  for (const Entry& entry : reader.entries) {
    if (auto why = check(entry, expected, data.size()); !why.empty())
      return fail(ErrorCode::bad_file, file + why);
    const auto begin = data.begin() + static_cast<std::ptrdiff_t>(expected);
    expected = entry.offsets[1];
    map.tensors.emplace(entry.name, Tensor{*entry.type,
                                           {entry.shape.begin(), entry.shape.end()},
                                           {begin, data.begin() + static_cast<std::ptrdiff_t>(expected)}});
  }
  if (expected != data.size()) {
    return fail(ErrorCode::bad_file, file + "byte " + std::to_string(length_bytes + *size + expected) + ": " +
                                         std::to_string(data.size() - expected) +
                                         " bytes belong to no tensor");
  }
  return map;
}

std::vector<std::byte> serialize_safetensors(const TensorMap& map) {
  std::string header = "{";
  const auto key = [&](const std::string& text) {
    if (header.back() != '{') header += ',';
    header += escaped(text) + ':';
  };
  if (!map.metadata.empty()) {
    key(std::string(metadata_key));
    header += '{';
    for (const auto& [name, value] : map.metadata) {
      key(name);
      header += escaped(value);
    }
    header += '}';
  }
  std::size_t end = 0;
  for (const auto& [tensor_name, tensor] : map.tensors) {
    const std::size_t begin = std::exchange(end, end + tensor.bytes.size());
    key(tensor_name);
    header += "{\"dtype\":\"" + std::string(name(tensor.type)) + "\",\"shape\":" + Json(tensor.shape).dump() +
              ",\"data_offsets\":" + Json(std::array{begin, end}).dump() + '}';
  }
  header += '}';
  header.append((8 - header.size() % 8) % 8, ' ');

  std::vector<std::byte> bytes;
  bytes.reserve(length_bytes + header.size() + end);
  for (std::size_t i = 0; i < length_bytes; ++i) {
    bytes.push_back(static_cast<std::byte>(std::uint64_t{header.size()} >> 8 * i));
  }
  const auto* text = reinterpret_cast<const std::byte*>(header.data());
  bytes.insert(bytes.end(), text, text + header.size());
  for (const auto& [tensor_name, tensor] : map.tensors) {
    bytes.insert(bytes.end(), tensor.bytes.begin(), tensor.bytes.end());
  }
  return bytes;
}

}  // namespace bitr::io
