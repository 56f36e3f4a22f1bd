#include "io/pickle.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "io/pickle_text.hpp"

namespace bitr::io::pickle {
namespace {

using namespace bitr::test;  // NOLINT: the vocabulary of this file
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

constexpr auto int64_max = std::numeric_limits<std::int64_t>::max();

Result<Document> unpickle(const std::string& pickle) {
  return parse(std::as_bytes(std::span(pickle.data(), pickle.size())), "p");
}

std::string bytes(std::initializer_list<int> values) {
  std::string out;
  for (const int value : values) out += static_cast<char>(value);
  return out;
}

template <class T>
T root(const std::string& body) {
  const std::string pickle = proto + body + ".";
  const auto document = unpickle(pickle);
  EXPECT_TRUE(document) << document.error().message;
  if (!document) return {};
  const T* value = document->get<T>(document->root);
  EXPECT_TRUE(value) << kind_name(document->values[document->root]);
  return value ? *value : T{};
}

TEST(Pickle, Numbers) {
  EXPECT_EQ(root<std::int64_t>("K\xff"), 255);
  EXPECT_EQ(root<std::int64_t>("M\xff\xff"), 65535);
  EXPECT_EQ(root<std::int64_t>(integer(-2)), -2);
  EXPECT_EQ(root<std::int64_t>(bytes({0x8a, 0})), 0);
  EXPECT_EQ(root<std::int64_t>(bytes({0x8a, 1, 0xff})), -1);
  EXPECT_EQ(root<std::int64_t>(bytes({0x8a, 5, 0, 0, 0, 0, 1})), 1ll << 32);
  EXPECT_EQ(root<std::int64_t>(wide(int64_max)), int64_max);
  EXPECT_EQ(root<std::int64_t>(wide(-int64_max - 1)), -int64_max - 1);
  EXPECT_EQ(root<double>(bytes({'G', 0xbf, 0xf8, 0, 0, 0, 0, 0, 0})), -1.5);
  EXPECT_TRUE(root<bool>("\x88"));
  EXPECT_FALSE(root<bool>("\x89"));
  root<None>("N");
}

TEST(Pickle, Text) {
  const std::string narrow = proto + bytes({0x8c, 2}) + "Δ.";
  EXPECT_EQ(*unpickle(narrow)->get<std::string_view>(0), "Δ");
  const std::string wide_text = proto + bytes({0x8d}) + count_bytes(3, 8) + "abc.";
  EXPECT_EQ(*unpickle(wide_text)->get<std::string_view>(0), "abc");
}

TEST(Pickle, Containers) {
  const std::string pickle = proto + "}(" + unicode("list") + "]q\x07(K\x01K\x02" + "e" + "K\x03" + "a" +
                             unicode("tuples") + "K\x01\x85K\x02\x86)N\x87" + "uK\x05h\x07s.";
  const auto document = unpickle(pickle);
  ASSERT_TRUE(document) << document.error().message;
  const auto* dict = document->get<Dict>(document->root);
  ASSERT_TRUE(dict);
  EXPECT_FALSE(dict->ordered);
  ASSERT_EQ(document->dicts[dict->index].size(), 3u);
  const auto& [five, again] = document->dicts[dict->index][2];
  EXPECT_EQ(*document->get<std::int64_t>(five), 5);
  EXPECT_EQ(again, document->dicts[dict->index][0].second);
  EXPECT_EQ(document->lists[document->get<List>(again)->index].size(), 3u);
  EXPECT_EQ(root<Tuple>("K\x01K\x02K\x03\x87").count, 3u);
}

TEST(Pickle, StackGlobalAndMemoizeAndFrame) {
  const std::string pickle = bytes({0x80, 4, 0x95}) + count_bytes(3, 8) + unicode("collections") + "\x94" +
                             unicode("OrderedDict") + "\x94\x93\x94)R\x94h\x02)R\x86.";
  const auto document = unpickle(pickle);
  ASSERT_TRUE(document) << document.error().message;
  const auto items = document->items(*document->get<Tuple>(document->root));
  EXPECT_TRUE(document->get<Dict>(items[0])->ordered);
  EXPECT_TRUE(document->get<Dict>(items[1])->ordered);
  EXPECT_NE(items[0], items[1]);
}

TEST(Pickle, VersionsOfAStateDictAreDropped) {
  EXPECT_TRUE(root<Dict>(ordered_dict + "}" + unicode("_metadata") + "}sb").ordered);
}

TEST(Pickle, Tensors) {
  const std::string pickle =
      proto + parameter(tensor(storage("HalfStorage", "7", 20), 2, {2, 3}, {1, 6})) + ".";
  const auto document = unpickle(pickle);
  ASSERT_TRUE(document) << document.error().message;
  const View& view = document->tensors[document->get<TensorRef>(document->root)->index];
  EXPECT_EQ(view.offset, 2u);
  EXPECT_EQ(view.size, 6u);
  EXPECT_EQ(document->storages[view.storage].type, DType::f16);
  EXPECT_EQ(document->storages[view.storage].key, "7");
  root<TensorRef>(tensor(storage("FloatStorage", "0", 1), 0, {}, {}));
  root<TensorRef>(tensor(storage("FloatStorage", "0", 0), 0, {0, 4}, {4, 1}));
}

TEST(Pickle, EveryStorage) {
  const std::pair<std::string, DType> table[] = {
      {"FloatStorage", DType::f32},     {"DoubleStorage", DType::f64}, {"HalfStorage", DType::f16},
      {"BFloat16Storage", DType::bf16}, {"LongStorage", DType::i64},   {"IntStorage", DType::i32},
      {"ShortStorage", DType::i16},     {"CharStorage", DType::i8},    {"ByteStorage", DType::u8},
      {"BoolStorage", DType::boolean}};
  for (const auto& [name, type] : table) EXPECT_EQ(root<Global>(global("torch", name)).type, type) << name;
}

struct Refused {
  std::string body;
  std::string message;
};

void expect_refused(const std::string& pickle, const std::string& message) {
  const auto document = unpickle(pickle);
  ASSERT_FALSE(document) << message;
  EXPECT_EQ(document.error().code, ErrorCode::bad_file);
  EXPECT_THAT(document.error().message,
              AllOf(StartsWith("p: byte "), HasSubstr(message), Not(HasSubstr("\n"))));
}

TEST(Pickle, CodeIsRefusedByName) {
  const std::string command = unicode("touch /tmp/x");
  const Refused table[] = {
      {global("os", "system") + tuple({command}) + "R", R"(byte 2: refuses global "os.system")"},
      {global("posix", "system"), R"(refuses global "posix.system")"},
      {global("__builtin__", "eval"), R"(refuses global "__builtin__.eval")"},
      {global("builtins", "eval"), R"(refuses global "builtins.eval")"},
      {global("builtins", "getattr"), R"(refuses global "builtins.getattr")"},
      {global("torch.storage", "_load_from_bytes"), R"(refuses global "torch.storage._load_from_bytes")"},
      {global("torch", "FloatStorage.__class__"), R"(refuses global "torch.FloatStorage.__class__")"},
      {global("torch.", "FloatStorage"), R"(refuses global "torch..FloatStorage")"},
      {global("", ""), R"(refuses global ".")"},
      {global("o\rs", "sys\tem\x1b[1m"), R"(refuses global "o\x0ds.sys\x09em\x1b[1m")"},
      {unicode("os") + unicode("system") + "\x93", R"(byte 20: refuses global "os.system")"},
      {"(ios\nsystem\n", "byte 3: refuses opcode 0x69 (INST)"},
      {std::string("(") + global("collections", "OrderedDict") + "o", "refuses opcode 0x6f (OBJ)"},
      {global("collections", "OrderedDict") + ")\x81", "byte 28: refuses opcode 0x81 (NEWOBJ)"},
      {global("collections", "OrderedDict") + ")}\x92", "refuses opcode 0x92 (NEWOBJ_EX)"},
      {"\x82\x01", "refuses opcode 0x82 (EXT1)"},
      {bytes({0x83, 1, 0}), "refuses opcode 0x83 (EXT2)"},
      {bytes({0x84, 1, 0, 0, 0}), "refuses opcode 0x84 (EXT4)"},
      {"P0\n", "refuses opcode 0x50 (PERSID)"},
      {bytes({0x8b, 0xff, 0xff, 0xff, 0x7f}), "refuses opcode 0x8b (LONG4)"},
      {"I1\n", "refuses opcode 0x49 (INT)"},
      {"S'a'\n", "refuses opcode 0x53 (STRING)"},
      {"C\x01"
       "a",
       "refuses opcode 0x43 (SHORT_BINBYTES)"},
      {"\x8f", "refuses opcode 0x8f (EMPTY_SET)"},
      {std::string("\x96") + count_bytes(1ull << 62, 8), "refuses opcode 0x96 (BYTEARRAY8)"},
      {"N2", "refuses opcode 0x32 (DUP)"},
      {"N0", "refuses opcode 0x30 (POP)"},
      {"\x07", "refuses opcode 0x07"},
      {"\xff", "refuses opcode 0xff"},
      {"}}b", "refuses opcode 0x62 (BUILD) of a dict from a dict"},
      {ordered_dict + "Nb", "refuses opcode 0x62 (BUILD) of a dict from None"},
      {global("torch", "FloatStorage") + "}b", "(BUILD) of a class from a dict"},
      {storage("FloatStorage", "0", 1) + "}b", "(BUILD) of a storage from a dict"},
      {global("torch", "FloatStorage") + ")R", "refuses to call the class of a storage"},
      {"K\x01)R", "refuses to call an integer"},
      {unicode("os.system") + ")R", "refuses to call text"},
      {ordered_dict + ")R", "refuses to call a dict"},
      {global("collections", "OrderedDict") + "]R", "the arguments of a call are not a tuple"},
      {global("collections", "OrderedDict") + "]\x85R", "OrderedDict has 1 arguments, not 0"},
  };
  for (const Refused& refused : table) expect_refused(proto + refused.body + ".", refused.message);
}

TEST(Pickle, Limits) {
  const std::string huge = count_bytes(1ull << 63, 8);
  const Refused table[] = {
      {"\x8d" + huge, "opcode 0x8d (BINUNICODE8) needs 9223372036854775808 bytes, 1 are left"},
      {"X\xff\xff\xff\xff", "needs 4294967295 bytes, 1 are left"},
      {"\x95" + huge, "opcode 0x95 (FRAME) needs 9223372036854775808 bytes, 1 are left"},
      {bytes({0x8a, 9, 1, 1, 1, 1, 1, 1, 1, 1, 1}), "integer of 9 bytes, limit 8"},
      {std::string("Nr") + count_bytes(1u << 31, 4), "memo entry 2147483648, limit 9"},
      {std::string("Nr") + count_bytes(9, 4), "memo entry 9, limit 9"},
      {std::string("j") + count_bytes(1u << 31, 4), "memo entry 2147483648 was never set"},
      {"h\x01", "memo entry 1 was never set"},
      {std::string("Nq\x01h") + bytes({0}), "memo entry 0 was never set"},
      {"q\x01", "opcode 0x71 (BINPUT) needs 1 values, the stack has 0"},
      {std::string(1001, '('), "byte 1002: more than 1000 marks"},
      {std::string((1 << 20) + 1, 'N'), "more than 1048576 values on the stack"},
      {unicode("\xc0\x80"), "text is not valid UTF-8"},
      {unicode("\xed\xa0\x80"), "text is not valid UTF-8"},
      {unicode("\xf4\x90\x80\x80"), "text is not valid UTF-8"},
      {"", "byte 2: STOP with 0 values and 0 marks"},
      {"NN", "STOP with 2 values and 0 marks"},
      {"N(", "STOP with 1 values and 1 marks"},
      {"N.N", "byte 3: 2 bytes follow STOP"},
      {"\x80\x02", "PROTO comes a second time"},
      {"cos", "a global's name without its end of line"},
      {"cos\nsystem", "a global's name without its end of line"},
      {"NN\x93", "a global's name is not text"},
  };
  for (const Refused& refused : table) expect_refused(proto + refused.body + ".", refused.message);
  expect_refused("", "byte 0: the pickle ends without STOP");
  expect_refused(".", "byte 0: a pickle of protocol 2 or later starts with PROTO");
  expect_refused("(dp0\n.", "starts with PROTO");
  expect_refused(bytes({0x80}), "opcode 0x80 (PROTO) needs 1 bytes, 0 are left");
  expect_refused(bytes({0x80, 1, 'N', '.'}), "protocol 1, not 2 to 5");
  expect_refused(bytes({0x80, 6, 'N', '.'}), "protocol 6, not 2 to 5");
  expect_refused(proto + std::string(std::size_t{64} << 20, 'N'), "67108866 bytes, limit 67108864");

  std::string many = proto;
  for (int i = 0; i < 1 << 22; ++i) many += "]";
  expect_refused(many, "on the stack");
  std::string values = proto + "]";
  for (int i = 0; i < 1 << 22; ++i) values += "Na";
  expect_refused(values, "more than 4194304 values");
}

TEST(Pickle, TheStackIsGuarded) {
  const Refused table[] = {
      {"\x85", "opcode 0x85 (TUPLE1) needs 1 values, the stack has 0"},
      {"N\x86", "needs 2 values, the stack has 1"},
      {"NN\x87", "needs 3 values, the stack has 2"},
      {"NN(N\x87", "needs 3 values, the stack has 1"},
      {"N(\x94", "needs 1 values, the stack has 0"},
      {"t", "opcode 0x74 (TUPLE) without a mark"},
      {"](Net", "opcode 0x74 (TUPLE) without a mark"},
      {"u", "opcode 0x75 (SETITEMS) without a mark"},
      {"e", "opcode 0x65 (APPENDS) without a mark"},
      {"(NNu", "opcode 0x75 (SETITEMS) without a dict"},
      {"}((NNu", "opcode 0x75 (SETITEMS) without a dict"},
      {"(Ne", "opcode 0x65 (APPENDS) without a list"},
      {"](NNu", "(SETITEMS) needs a dict, not a list"},
      {"}(Ne", "(APPENDS) needs a list, not a dict"},
      {"}(NNNu", "a key without a value"},
      {"Na", "opcode 0x61 (APPEND) needs 2 values"},
      {"NNa", "needs a list, not None"},
      {"](Na", "opcode 0x61 (APPEND) needs 2 values, the stack has 1"},
      {"NNs", "opcode 0x73 (SETITEM) needs 3 values"},
      {"NNNs", "needs a dict, not None"},
      {"R", "needs 2 values, the stack has 0"},
      {"Q", "needs 1 values, the stack has 0"},
      {"b", "needs 2 values, the stack has 0"},
      {"N\x93", "needs 2 values, the stack has 1"},
  };
  for (const Refused& refused : table) expect_refused(proto + refused.body + ".", refused.message);
}

TEST(Pickle, StoragesAndTensorsAreChecked) {
  const std::string ten = storage("FloatStorage", "0", 10);
  const std::string rebuild = global("torch._utils", "_rebuild_tensor_v2");
  const Refused table[] = {
      {"NQ", "a persistent id is not a tuple of 5 values"},
      {")Q", "a persistent id is not a tuple of 5 values"},
      {"(NNNNNtQ", R"(a persistent id is not ("storage", class, key, device, size))"},
      {tuple({unicode("module"), global("torch", "FloatStorage"), unicode("0"), unicode("cpu"), integer(1)}) +
           "Q",
       "a persistent id is not"},
      {tuple({unicode("storage"), global("collections", "OrderedDict"), unicode("0"), unicode("cpu"),
              integer(1)}) +
           "Q",
       "a persistent id is not"},
      {storage("FloatStorage", "0", -1), "a storage of -1 elements"},
      {storage("UntypedStorage", "0", 1), R"(refuses global "torch.UntypedStorage")"},
      {rebuild + ")R", "_rebuild_tensor_v2 has 0 arguments, not 6 or 7"},
      {rebuild + "(NNNNNNtR", "_rebuild_tensor_v2 needs (storage, offset"},
      {tensor(ten, -1, {1}, {1}), "a tensor's offset is -1"},
      {tensor(ten, 0, {2, 2}, {1}), "a tensor has 2 extents and 1 strides"},
      {tensor(ten, 0, {-1}, {1}), "extents and strides are integers from 0 up"},
      {tensor(ten, 0, {1}, {-1}), "extents and strides are integers from 0 up"},
      {tensor(ten, 10, {}, {}), "a tensor reaches element 10, its storage has 10"},
      {tensor(ten, 0, {11}, {1}), "a tensor reaches element 10, its storage has 10"},
      {tensor(ten, 1, {2, 5}, {5, 1}), "a tensor reaches element 10"},
      {tensor(ten, 0, {3, 3}, {4, 1}), "a tensor reaches element 10"},
      {tensor(ten, 0, {11}, {0}), "a tensor of 11 elements, its storage has 10"},
      {tensor(ten, 0, {1ll << 62}, {0}), "a tensor of 4611686018427387904 elements"},
      {tensor(ten, 0, {1ll << 32, 1ll << 32}, {0, 0}), "overflows 64 bits"},
      {tensor(ten, 0, {2, int64_max, 2, 2, 0}, {0, 0, 0, 0, 0}), "overflows 64 bits"},
      {tensor(ten, 0, {3}, {int64_max}), "a tensor reaches element 18446744073709551614"},
      {tensor(ten, 9, {3}, {int64_max}), "overflows 64 bits"},
      {tensor(ten, 0, {4}, {int64_max}), "overflows 64 bits"},
      {tensor(ten, int64_max, {1}, {1}), "a tensor reaches element 9223372036854775807"},
      {rebuild +
           tuple({ten, integer(0), std::string("(") + unicode("3") + "t", integers({1}), "\x89",
                  ordered_dict}) +
           "R",
       "extents and strides are integers"},
      {global("torch._utils", "_rebuild_parameter") + tuple({ten, "\x89", ordered_dict}) + "R",
       "_rebuild_parameter needs (tensor, flag, hooks)"},
      {global("torch._utils", "_rebuild_parameter") + ")R", "_rebuild_parameter needs"},
  };
  for (const Refused& refused : table) expect_refused(proto + refused.body + ".", refused.message);

  std::string ones = "(";
  for (int i = 0; i < 65; ++i) ones += "K\x01";
  ones += "t";
  expect_refused(proto + rebuild + tuple({ten, integer(0), ones, ones, "\x89", ordered_dict}) + "R.",
                 "a tensor has 65 extents and 65 strides, limit 64");
}

// Each level holds the one below a hundred times over: a copy would need 100^50 values.
TEST(Pickle, SharingIsNeverExpanded) {
  std::string pickle = proto + "]\x94";
  for (int level = 0; level < 50; ++level) {
    pickle += "](";
    for (int i = 0; i < 100; ++i) pickle += std::string("h") + static_cast<char>(level);
    pickle += "e\x94\x86";
  }
  const auto document = unpickle(pickle + ".");
  ASSERT_TRUE(document) << document.error().message;
  EXPECT_EQ(document->lists.size(), 51u);
}

TEST(Pickle, ACycleIsOnlyAReference) {
  const auto document = unpickle(proto + "]q" + bytes({0}) + "h" + bytes({0}) + "a.");
  ASSERT_TRUE(document) << document.error().message;
  EXPECT_EQ(document->lists[0], std::vector<Id>{document->root});
}

TEST(Pickle, AMillionLevelsDeep) {
  const auto document = unpickle(proto + "N" + std::string(1'000'000, '\x85') + ".");
  ASSERT_TRUE(document) << document.error().message;
  EXPECT_EQ(document->values.size(), 1'000'001u);
}

TEST(Pickle, EveryTruncationIsAnError) {
  const std::string pickle = proto + ordered_dict + "(" + unicode("w") +
                             parameter(tensor(storage("FloatStorage", "0", 6), 0, {2, 3}, {3, 1})) +
                             unicode("epoch") + bytes({'G', 0, 0, 0, 0, 0, 0, 0, 0}) + "u}" +
                             unicode("_metadata") + "}sb.";
  ASSERT_TRUE(unpickle(pickle));
  for (std::size_t size = 0; size < pickle.size(); ++size)
    EXPECT_FALSE(unpickle(pickle.substr(0, size))) << size;
}

}  // namespace
}  // namespace bitr::io::pickle
