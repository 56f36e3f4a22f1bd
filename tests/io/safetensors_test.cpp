#include "io/safetensors.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <filesystem>
#include <fstream>
#include <string>

#include "support/paths.hpp"

namespace bitr::io {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

std::vector<std::byte> to_bytes(std::string_view text) {
  const auto* begin = reinterpret_cast<const std::byte*>(text.data());
  return {begin, begin + text.size()};
}

std::vector<std::byte> file_of(std::string_view header, std::size_t data, std::uint64_t claimed) {
  std::string text;
  for (int i = 0; i < 8; ++i) text += static_cast<char>(claimed >> 8 * i);
  return to_bytes(text.append(header) + std::string(data, '\1'));
}

std::vector<std::byte> file_of(std::string_view header, std::size_t data) {
  return file_of(header, data, header.size());
}

std::vector<std::byte> read(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  return to_bytes(std::string(std::istreambuf_iterator<char>(stream), {}));
}

TensorMap sample() {
  TensorMap map;
  map.tensors["weight"] = Tensor::from({2, 3}, std::vector<float>{1, -2, 3.5f, 0, 1e-30f, 6});
  map.tensors["a.scalar"] = Tensor::from({}, std::vector<double>{0.1});
  map.tensors["empty"] = Tensor::from({0, 7}, std::vector<float>{});
  map.tensors["Δ \"quoted\"\n"] = Tensor::from({2}, std::vector<std::int64_t>{-1, 1ll << 60});
  map.metadata = {{"bitr.config", R"({"k": [1, 2]})"}, {"", "empty key"}};
  return map;
}

void expect_equal(const TensorMap& a, const TensorMap& b) {
  EXPECT_EQ(a.metadata, b.metadata);
  ASSERT_EQ(a.tensors.size(), b.tensors.size());
  for (const auto& [name, tensor] : a.tensors) {
    ASSERT_TRUE(b.tensors.contains(name)) << name;
    const Tensor& other = b.tensors.at(name);
    EXPECT_EQ(tensor.type, other.type) << name;
    EXPECT_EQ(tensor.shape, other.shape) << name;
    EXPECT_EQ(tensor.bytes, other.bytes) << name;
  }
}

TEST(Safetensors, RoundTrip) {
  const auto bytes = serialize_safetensors(sample());
  EXPECT_EQ(std::to_integer<int>(bytes[0]) % 8, 0) << "the data starts on a multiple of 8";
  const auto map = parse_safetensors(bytes, "sample");
  ASSERT_TRUE(map) << map.error().message;
  expect_equal(sample(), *map);
  EXPECT_EQ(serialize_safetensors(*map), bytes);
}

TEST(Safetensors, EveryDType) {
  TensorMap map;
  for (const DType type : {DType::f16, DType::bf16, DType::f32, DType::f64, DType::i8, DType::u8, DType::i16,
                           DType::i32, DType::i64, DType::boolean}) {
    map.tensors[std::string(name(type))] = {
        type, {3}, std::vector<std::byte>(3 * size_of(type), std::byte{1})};
  }
  const auto read_back = parse_safetensors(serialize_safetensors(map), "types");
  ASSERT_TRUE(read_back) << read_back.error().message;
  expect_equal(map, *read_back);
}

TEST(Safetensors, NoTensors) {
  const auto map = parse_safetensors(file_of("{}", 0), "none");
  ASSERT_TRUE(map);
  EXPECT_TRUE(map->tensors.empty());
}

TEST(Safetensors, HeaderInAnyOrderWithBlanks) {
  const auto map = parse_safetensors(file_of(R"({ "b": {"data_offsets":[2,4], "shape":[1], "dtype":"I16"},
      "a":{"dtype":"U8","shape":[2,1],"data_offsets":[0,2]}, "__metadata__":{"k":"v"} }   )",
                                             4),
                                     "order");
  ASSERT_TRUE(map) << map.error().message;
  EXPECT_THAT(map->tensors.at("a").shape, ElementsAre(2, 1));
  EXPECT_THAT(map->tensors.at("b").to_double(), ElementsAre(257));
  EXPECT_EQ(map->metadata.at("k"), "v");
}

TEST(Safetensors, AnEmptyTensorMayBeWide) {
  TensorMap map;
  map.tensors["x"] = {DType::f64, {std::size_t{1} << 62, 0}, {}};
  const auto again = parse_safetensors(serialize_safetensors(map), "wide");
  ASSERT_TRUE(again) << again.error().message;
  expect_equal(map, *again);
}

struct MalformedWeights {
  std::string header;
  std::size_t data;
  std::string message;
};

TEST(Safetensors, MalformedHeaders) {
  const auto entry = [](std::string dtype, std::string shape, std::string offsets) {
    return R"({"x":{"dtype":)" + dtype + R"(,"shape":)" + shape + R"(,"data_offsets":)" + offsets + "}}";
  };
  const auto two = [](std::string first, std::string second) {
    return R"({"x":{"dtype":"U8","shape":[4],"data_offsets":)" + first +
           R"(},"y":{"dtype":"U8","shape":[4],"data_offsets":)" + second + "}}";
  };
  const MalformedWeights table[] = {
      {"", 0, "byte 8: the header does not start with '{'"},
      {" {}", 0, "byte 8: the header does not start with '{'"},
      {"[]", 0, "does not start with '{'"},
      {"{", 0, "byte 9: the header is not valid JSON"},
      {"{}{}", 0, "byte 10: the header is not valid JSON"},
      {"{\"a\xff\":{}}", 0, "not valid JSON"},
      {R"({"x":[1]})", 0, R"("x" holds an array, not an object)"},
      {R"({"x":1})", 0, R"("x" holds a number, not an object)"},
      {R"({"x":null})", 0, R"("x" holds null)"},
      {R"({"x":true})", 0, R"("x" holds a boolean)"},
      {R"({"x":"y"})", 0, R"("x" holds a string)"},
      {R"({"x":{"shape":[1],"data_offsets":[0,1]}})", 1, R"(tensor "x": dtype is missing)"},
      {R"({"x":{"dtype":"U8","data_offsets":[0,1]}})", 1, R"(tensor "x": shape is missing)"},
      {R"({"x":{"dtype":"U8","shape":[1]}})", 1, R"(tensor "x": data_offsets is missing)"},
      {R"({"x":{"dtype":"U8","dtype":"U8"}})", 1, R"(tensor "x": dtype appears twice)"},
      {R"({"x":{"shape":[1],"shape":[1]}})", 1, R"(tensor "x": shape appears twice)"},
      {R"({"x":{"data_offsets":[1,1],"data_offsets":[1,2]}})", 1,
       R"(tensor "x": data_offsets appears twice)"},
      {R"({"x":{"dtype":"U8","shape":[1],"data_offsets":[0,1],"extra":"1"}})", 1,
       R"("extra" holds a string)"},
      {R"({"x":{"shape":{"a":1}}})", 0, R"("shape" holds an object)"},
      {R"({"x":{"shape":[[1]]}})", 0, R"("shape" holds an array)"},
      {R"({"x":{"shape":["1"]}})", 0, R"("shape" holds a string)"},
      {entry("\"F31\"", "[1]", "[0,4]"), 4, R"(tensor "x": unknown dtype "F31")"},
      {entry("3", "[1]", "[0,4]"), 4, R"("dtype" holds a number)"},
      {entry("\"F32\"", "[-1]", "[0,4]"), 4, R"("shape" holds a negative number)"},
      {entry("\"F32\"", "[1.0]", "[0,4]"), 4, R"("shape" holds a fraction)"},
      {entry("\"F32\"", "[1e400]", "[0,4]"), 4, "not valid JSON"},
      {entry("\"F32\"", "[18446744073709551616]", "[0,4]"), 4, R"("shape" holds a fraction)"},
      {entry("\"F32\"", "[1]", "[0]"), 4, "data_offsets has 1 numbers, not 2"},
      {entry("\"F32\"", "[1]", "[0,4,8]"), 4, "data_offsets has 3 numbers, not 2"},
      {entry("\"F32\"", "[1]", "[0,4]"), 3,
       R"(tensor "x": data_offsets [0, 4] run past the buffer's 3 bytes)"},
      {entry("\"F32\"", "[1]", "[0,18446744073709551615]"), 4, "run past the buffer's 4 bytes"},
      {entry("\"F32\"", "[1]", "[4,0]"), 4, "data_offsets [4, 0] run backwards"},
      {entry("\"F32\"", "[2]", "[0,4]"), 4, "hold 4 bytes, its shape and dtype need 8"},
      {entry("\"F64\"", "[]", "[0,4]"), 4, "hold 4 bytes, its shape and dtype need 8"},
      {entry("\"F32\"", "[0]", "[0,4]"), 4, "hold 4 bytes, its shape and dtype need 0"},
      {entry("\"F32\"", "[4294967296,4294967297]", "[0,4]"), 4, "the product of its shape overflows 64 bits"},
      {entry("\"F32\"", "[4611686018427387905]", "[0,4]"), 4, "the product of its shape overflows 64 bits"},
      {entry("\"U8\"", "[3]", "[1,4]"), 4, "data_offsets [1, 4] leave a hole from 0"},
      {two("[0,4]", "[4,8]"), 9, "1 bytes belong to no tensor"},
      {two("[0,4]", "[3,7]"), 8, R"(tensor "y": data_offsets [3, 7] overlap the bytes before 4)"},
      {two("[0,4]", "[0,4]"), 4, "overlap the bytes before 4"},
      {two("[5,9]", "[0,4]"), 9, R"(tensor "x": data_offsets [5, 9] leave a hole from 4)"},
      {R"({"x":{"dtype":"U8","shape":[1],"data_offsets":[0,1]},"x":{}})", 1, R"("x" appears twice)"},
      {R"({"__metadata__":{},"__metadata__":{}})", 0, R"("__metadata__" appears twice)"},
      {R"({"__metadata__":{"k":"1","k":"2"}})", 0, R"(metadata key "k" appears twice)"},
      {R"({"__metadata__":{"k":1}})", 0, R"(metadata "k" holds a number, not a string)"},
      {R"({"__metadata__":{"k":{}}})", 0, R"(metadata "k" holds an object, not a string)"},
      {R"({"__metadata__":"k"})", 0, R"("__metadata__" holds a string)"},
      {R"({"a\nb\u0007":0})", 0, R"("a\x0ab\x07" holds a number)"},
  };
  for (const MalformedWeights& malformed : table) {
    const auto map = parse_safetensors(file_of(malformed.header, malformed.data), "bad.safetensors");
    ASSERT_FALSE(map) << malformed.header;
    EXPECT_EQ(map.error().code, ErrorCode::bad_file);
    EXPECT_THAT(map.error().message,
                AllOf(StartsWith("bad.safetensors: "), HasSubstr(malformed.message), Not(HasSubstr("\n"))))
        << malformed.header;
  }
}

TEST(Safetensors, HeaderLength) {
  for (const std::uint64_t claimed : {std::uint64_t{3}, std::uint64_t{1} << 32, ~std::uint64_t{0}}) {
    const auto map = parse_safetensors(file_of("{}", 0, claimed), "long");
    ASSERT_FALSE(map);
    EXPECT_EQ(map.error().message, "long: byte 0: header of " + std::to_string(claimed) + " bytes, limit 2");
  }
  const auto map = parse_safetensors(to_bytes("1234567"), "short");
  ASSERT_FALSE(map);
  EXPECT_THAT(map.error().message, HasSubstr("7 bytes"));
}

TEST(Safetensors, DeepNestingStopsAtOnce) {
  const auto map = parse_safetensors(file_of(R"({"x":)" + std::string(1'000'000, '['), 0), "deep");
  ASSERT_FALSE(map);
  EXPECT_THAT(map.error().message, HasSubstr(R"("x" holds an array)"));
}

TEST(Safetensors, EveryTruncationAndEveryFlippedByteIsHandled) {
  const auto bytes = serialize_safetensors(sample());
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    const auto map = parse_safetensors(std::span(bytes).first(size), "cut");
    ASSERT_FALSE(map) << size;
    EXPECT_EQ(map.error().code, ErrorCode::bad_file);
  }
  for (std::size_t at = 0; at < bytes.size(); ++at) {
    for (const std::byte flip : {std::byte{1}, std::byte{0x80}, std::byte{0xff}}) {
      auto changed = bytes;
      changed[at] ^= flip;
      const auto map = parse_safetensors(changed, "changed");
      EXPECT_TRUE(map || !map.error().message.empty());
    }
  }
}

TEST(Safetensors, GoldenWeights) {
  const auto map = parse_safetensors(read(test::data_dir() / "golden/weights_01.safetensors"), "weights_01");
  ASSERT_TRUE(map) << map.error().message;
  EXPECT_EQ(map->metadata.at("return_normals"), "0");
  std::size_t elements = 0;
  for (const auto& [name, tensor] : map->tensors) elements += tensor.size();
  EXPECT_EQ(elements, 161'316u + 9 + 81) << "the parameters and the buffers Q and Q_tensor";
  const auto again = parse_safetensors(serialize_safetensors(*map), "again");
  ASSERT_TRUE(again);
  expect_equal(*map, *again);
}

}  // namespace
}  // namespace bitr::io
