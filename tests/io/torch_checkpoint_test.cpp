#include "io/torch_checkpoint.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <fstream>

#include "io/pickle_text.hpp"
#include "io/safetensors.hpp"
#include "support/paths.hpp"

namespace bitr::io {
namespace {

using namespace bitr::test;  // NOLINT: the vocabulary of this file
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

Result<TensorMap> load(const std::string& file) {
  return parse_torch_checkpoint(std::as_bytes(std::span(file.data(), file.size())), "c.pt");
}

std::string bytes_of(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// The floats 0, 1, 2, … as a storage's bytes.
std::string counting(int count) {
  std::string bytes;
  for (int i = 0; i < count; ++i) {
    const auto value = static_cast<float>(i);
    char raw[4];
    std::memcpy(raw, &value, 4);
    bytes.append(raw, 4);
  }
  return bytes;
}

const std::string six = storage("FloatStorage", "0", 6);

std::string dict(std::initializer_list<std::string> keys_and_values) {
  std::string bytes = "}(";
  for (const std::string& item : keys_and_values) bytes += item;
  return bytes + "u";
}

/// An archive of this pickle and one storage "0" of six floats.
std::string archive(const std::string& body, zip_int32_t method = ZIP_CM_STORE) {
  return zip_of({{"model/data.pkl", proto + body + ".", method},
                 {"model/byteorder", "little"},
                 {"model/data/0", counting(6), method},
                 {"model/version", "3\n"}});
}

TEST(TorchCheckpoint, StateDictWithViewsAndTiedTensors) {
  for (const zip_int32_t method : {ZIP_CM_STORE, ZIP_CM_DEFLATE}) {
    const auto map = load(archive(dict({unicode("w"), tensor(six, 0, {2, 3}, {3, 1}),               //
                                        unicode("transposed"), tensor(six, 0, {3, 2}, {1, 3}),      //
                                        unicode("parameter"), parameter(tensor(six, 4, {2}, {1})),  //
                                        unicode("every other"), tensor(six, 1, {3}, {2}),           //
                                        unicode("scalar"), tensor(six, 5, {}, {}),                  //
                                        unicode("expanded"), tensor(six, 2, {1, 2, 2}, {9, 0, 3}),  //
                                        unicode("empty"), tensor(six, 0, {0, 4}, {4, 1})}),
                                  method));
    ASSERT_TRUE(map) << map.error().message;
    ASSERT_EQ(map->tensors.size(), 7u);
    EXPECT_THAT(map->tensors.at("w").shape, ElementsAre(2, 3));
    EXPECT_THAT(map->tensors.at("w").to_double(), ElementsAre(0, 1, 2, 3, 4, 5));
    EXPECT_THAT(map->tensors.at("transposed").shape, ElementsAre(3, 2));
    EXPECT_THAT(map->tensors.at("transposed").to_double(), ElementsAre(0, 3, 1, 4, 2, 5));
    EXPECT_THAT(map->tensors.at("parameter").to_double(), ElementsAre(4, 5));
    EXPECT_THAT(map->tensors.at("every other").to_double(), ElementsAre(1, 3, 5));
    EXPECT_THAT(map->tensors.at("scalar").to_double(), ElementsAre(5));
    EXPECT_THAT(map->tensors.at("expanded").to_double(), ElementsAre(2, 5, 2, 5));
    EXPECT_THAT(map->tensors.at("empty").shape, ElementsAre(0, 4));
    EXPECT_TRUE(map->tensors.at("empty").bytes.empty());
  }
}

TEST(TorchCheckpoint, TrainingCheckpoint) {
  const std::string w = tensor(six, 0, {6}, {1});
  const std::string group = dict({unicode("lr"), std::string("G\x3f\x50\0\0\0\0\0\0", 9),  //
                                  unicode("betas"), std::string("G") + std::string(8, '\0') + "K\x01\x86",
                                  unicode("amsgrad"), "\x89", unicode("foreach"), "N", unicode("params"),
                                  std::string("](K\0K\x01"
                                              "e",
                                              7)});
  const std::string optimizer = dict(
      {unicode("state"), dict({std::string("K\0", 2), dict({unicode("step"), w, unicode("exp_avg"), w})}),
       unicode("param_groups"), "](" + group + "e"});
  const auto map = load(archive(dict({unicode("epoch"), "K\x07", unicode("model_state_dict"),
                                      dict({unicode("w"), w}), unicode("optimizer_state_dict"), optimizer})));
  ASSERT_TRUE(map) << map.error().message;
  ASSERT_EQ(map->tensors.size(), 1u);
  EXPECT_THAT(map->tensors.at("w").to_double(), ElementsAre(0, 1, 2, 3, 4, 5));

  const auto other =
      load(archive(dict({unicode("state_dict"), ordered_dict + "(" + unicode("v") + w + "u"})));
  ASSERT_TRUE(other) << other.error().message;
  EXPECT_TRUE(other->tensors.contains("v"));
}

struct MalformedArchive {
  std::string file;
  std::string message;
};

TEST(TorchCheckpoint, Malformed) {
  const std::string w = tensor(six, 0, {6}, {1});
  const std::string good = proto + dict({unicode("w"), w}) + ".";
  const std::string legacy("\x80\x02\x8a\x0a\x6c\xfc\x9c\x46\xf9\x20\x6a\xa8\x50\x19.", 15);
  std::string tied = "}(";
  for (int i = 0; i < 5000; ++i) tied += unicode(std::to_string(i)) + "h\x01";
  const std::string zeros = storage("FloatStorage", "0", 1 << 16);
  const MalformedArchive table[] = {
      {"", "no data.pkl"},
      {"PK\x03\x04", "not a zip archive"},
      {"not a zip at all, but long enough to look for an end of directory", "not a zip archive"},
      {legacy, "torch.save's format before PyTorch 1.6"},
      {zip_of({{"a.txt", "a"}}), "no data.pkl: not an archive of torch.save"},
      {zip_of({{"data.pkl", good}}), "no data.pkl"},
      {zip_of({{"a/b/data.pkl", good}}), "no data.pkl"},
      {zip_of({{"a/data.pkl", good}, {"b/data.pkl", good}}), "more than one data.pkl"},
      {zip_of({{"a/data.pkl", good}, {"a/constants.pkl", good}}), "a TorchScript archive"},
      {zip_of({{"a/data.pkl", good}, {"a/byteorder", "big"}}), R"(byte order "big", not "little")"},
      {zip_of({{"a/data.pkl", good}}), R"(tensor "w": entry "a/data/0" is missing)"},
      {zip_of({{"a/data.pkl", good}, {"a/data/0", "123"}}),
       R"(tensor "w": storage "0" has 3 bytes, its class and length need 24)"},
      {zip_of({{"a/data.pkl", proto + dict({unicode("w"), tensor(zeros, 0, {1}, {1})}) + ".", ZIP_CM_DEFLATE},
               {"a/data/0", std::string(1 << 24, '\0'), ZIP_CM_DEFLATE}}),
       R"(tensor "w": entry "a/data/0" unpacks to 16777216 bytes, limit )"},
      {zip_of({{"a/data.pkl", good}, {"a/data/0", counting(6), ZIP_CM_BZIP2}}),
       "compression method 12 is neither stored nor deflate"},
      {zip_of({{"a/data.pkl", proto + "N" + tensor(zeros, 0, {1 << 16}, {1}) + "q\x01\x86" + tied + "u\x86."},
               {"a/data/0", std::string(1 << 18, '\0')}}),
       "holds a tuple, not a state dict"},
      {zip_of({{"a/data.pkl", proto + "}(" + unicode("w") + tensor(zeros, 0, {1 << 16}, {1}) + "q\x01" +
                                  tied.substr(2) + "u."},
               {"a/data/0", std::string(1 << 18, '\0')}}),
       "the tensors pass "},
      {archive("N"), "holds None, not a state dict"},
      {archive(w), "holds a tensor, not a state dict"},
      {archive(dict({unicode("model_state_dict"), "N"})), R"(entry "model_state_dict" is None, not a dict)"},
      {archive(dict({unicode("epoch"), "K\x01"})), R"(entry "epoch" is an integer, not a tensor)"},
      {archive(dict({"K\x01", w})), "a tensor's name is an integer, not text"},
      {archive(dict({unicode("w"), w, unicode("w"), w})), R"(tensor "w" appears twice)"},
      {archive(dict({unicode("__metadata__"), w})), "this name is reserved"},
      {archive(dict({unicode("w"), tensor(storage("DoubleStorage", "0", 6), 0, {6}, {1})})),
       "has 24 bytes, its class"},
      {archive(dict({unicode("w"), tensor(storage("DoubleStorage", "0", 1ll << 61), 0, {6}, {1})})),
       "a storage of 2305843009213693952 elements"},
      {archive(dict({unicode("w"), tensor(storage("FloatStorage", std::string(256, '0'), 6), 0, {6}, {1})})),
       "a storage's key has 256 bytes, limit 255"},
      {archive(global("os", "system") + tuple({unicode("id")}) + "R"),
       R"(c.pt: data.pkl: byte 2: refuses global "os.system")"},
  };
  for (const MalformedArchive& malformed : table) {
    const auto map = load(malformed.file);
    ASSERT_FALSE(map) << malformed.message;
    EXPECT_THAT(map.error().message,
                AllOf(StartsWith("c.pt: "), HasSubstr(malformed.message), Not(HasSubstr("\n"))));
  }
}

TEST(TorchCheckpoint, DamageIsFound) {
  std::string file = archive(dict({unicode("w"), tensor(six, 0, {6}, {1})}));
  const std::size_t at = file.find(counting(6));
  ASSERT_NE(at, std::string::npos);
  file[at + 5] ^= 1;
  const auto map = load(file);
  ASSERT_FALSE(map);
  EXPECT_THAT(map.error().message, HasSubstr(R"(tensor "w": entry "model/data/0" is damaged: CRC error)"));
}

TEST(TorchCheckpoint, EveryTruncationAndEveryFlippedByteIsHandled) {
  for (const zip_int32_t method : {ZIP_CM_STORE, ZIP_CM_DEFLATE}) {
    const std::string file = archive(dict({unicode("w"), tensor(six, 0, {6}, {1})}), method);
    ASSERT_TRUE(load(file));
    for (std::size_t size = 0; size < file.size(); ++size) EXPECT_FALSE(load(file.substr(0, size))) << size;
    for (std::size_t at = 0; at < file.size(); ++at) {
      for (const int flip : {1, 0x80, 0xff}) {
        std::string changed = file;
        changed[at] = static_cast<char>(changed[at] ^ flip);
        const auto map = load(changed);
        EXPECT_TRUE(map || !map.error().message.empty());
      }
    }
  }
}

TEST(TorchCheckpoint, GoldenCheckpoint) {
  const auto map = load(bytes_of(data_dir() / "golden/checkpoint_00_state_dict.pt"));
  ASSERT_TRUE(map) << map.error().message;
  EXPECT_EQ(map->tensors.size(), 1269u);
  std::size_t elements = 0;
  for (const auto& [name, tensor] : map->tensors) {
    elements += tensor.size();
    EXPECT_EQ(tensor.bytes.size(), tensor.size() * size_of(tensor.type)) << name;
  }
  EXPECT_EQ(elements, 370'818u);
  const auto again = parse_safetensors(serialize_safetensors(*map), "converted");
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(again->tensors.size(), map->tensors.size());
}

TEST(TorchCheckpoint, GoldenCheckpointEqualsItsSafetensors) {
  const std::filesystem::path path = source_dir() / "../shared/golden/weights_00.safetensors";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is not here";
  const auto checkpoint = load(bytes_of(data_dir() / "golden/checkpoint_00_state_dict.pt"));
  const std::string file = bytes_of(path);
  const auto weights = parse_safetensors(std::as_bytes(std::span(file.data(), file.size())), "weights_00");
  ASSERT_TRUE(checkpoint && weights);
  ASSERT_EQ(checkpoint->tensors.size(), weights->tensors.size());
  for (const auto& [name, tensor] : weights->tensors) {
    ASSERT_TRUE(checkpoint->tensors.contains(name)) << name;
    const Tensor& other = checkpoint->tensors.at(name);
    EXPECT_EQ(other.shape, tensor.shape) << name;
    EXPECT_EQ(other.type, tensor.type) << name;
    EXPECT_EQ(other.bytes, tensor.bytes) << name;
  }
}

}  // namespace
}  // namespace bitr::io
