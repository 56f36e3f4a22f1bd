#include "../io/pickle_text.hpp"
#include "corpus.hpp"

namespace {

using namespace bitr::test;  // NOLINT: the vocabulary of this file

std::string safetensors(std::string_view header, std::size_t bytes) {
  return count_bytes(header.size(), 8).append(header).append(bytes, '\x40');
}

std::string dict(std::initializer_list<std::string> keys_and_values) {
  std::string bytes = "}(";
  for (const std::string& item : keys_and_values) bytes += item;
  return bytes + "u";
}

const std::string six = storage("FloatStorage", "0", 6);

std::string pickle(const std::string& body) { return (proto + body).append("."); }

std::string every_storage() {
  std::string items = ordered_dict + "(";
  for (const std::string type :
       {"Float", "Double", "Half", "BFloat16", "Long", "Int", "Short", "Char", "Byte", "Bool"}) {
    items += unicode(type) + tensor(storage(type + "Storage", "0", 3), 0, {3}, {1});
  }
  return pickle(items + "u");
}

std::string protocol_four() {
  return std::string("\x80\x04\x95") + count_bytes(60, 8) + "\x8c\x0b" + "collections" +
         "\x94\x8c\x0bOrderedDict\x94\x93\x94)R\x94" + "(\x8d" + count_bytes(1, 8) + "w" +
         parameter(tensor(six, 1, {2, 1}, {1, 2})) + "\x94\x8c\x01v" + "h\x04u.";
}

const std::string training =
    pickle(dict({unicode("epoch"), "M\x01\x01", unicode("model_state_dict"),
                 dict({unicode("w"), tensor(six, 0, {3, 2}, {1, 3})}), unicode("optimizer_state_dict"),
                 dict({unicode("state"), dict({"K\x01", dict({unicode("step"), tensor(six, 5, {}, {})})}),
                       unicode("param_groups"),
                       "](}(" + unicode("lr") + "G\x3f\xf0\x01\x01\x01\x01\x01\x01" + unicode("betas") +
                           "\x88\x89N\x87" + unicode("n") + integer(-1) + "ue"})}));

}  // namespace

void write_weight_seeds(WriteSeed seed) {
  seed("safetensors", "empty", safetensors("{}", 0));
  seed("safetensors", "two",
       safetensors(R"({"__metadata__":{"k":"v","bitr.config":"{\"a\": 1}"},)"
                   R"("a":{"dtype":"F32","shape":[2,1],"data_offsets":[0,8]},)"
                   R"("b":{"dtype":"I64","shape":[],"data_offsets":[8,16]}})",
                   16));
  seed("safetensors", "types",
       safetensors(R"({ "h":{"data_offsets":[0,4],"dtype":"F16","shape":[2]},)"
                   R"("g":{"data_offsets":[4,6],"dtype":"BF16","shape":[1,1,1]},)"
                   R"("e":{"data_offsets":[6,6],"dtype":"F64","shape":[0,3]},)"
                   R"("\u0394\n":{"data_offsets":[6,7],"dtype":"BOOL","shape":[1]},)"
                   R"("u":{"data_offsets":[7,8],"dtype":"U8","shape":[1]}} )",
                   8));

  seed("pickle", "state_dict", pickle(dict({unicode("w"), tensor(six, 0, {2, 3}, {3, 1})})));
  seed("pickle", "views",
       pickle(dict({unicode("t"), tensor(six, 0, {3, 2}, {1, 3}), unicode("s"), tensor(six, 1, {3}, {2}),
                    unicode("x"), tensor(six, 2, {1, 2, 2}, {9, 0, 3}), unicode("e"),
                    tensor(six, 0, {0, 4}, {4, 1})})));
  seed("pickle", "wide_and_empty", pickle(dict({unicode("w"), tensor(six, 0, {1ll << 62, 0}, {1, 1})})));
  seed("pickle", "versions",
       pickle(ordered_dict + unicode("w") + tensor(six, 0, {6}, {1}) + "s}" + unicode("_metadata") + "}sb"));
  seed("pickle", "memo",
       pickle("}q\x01(" + unicode("a") + tensor(six, 0, {6}, {1}) + "r" + count_bytes(2, 4) + unicode("b") +
              "j" + count_bytes(2, 4) + unicode("c") + "h\x02u"));
  seed("pickle", "storages", every_storage());
  seed("pickle", "protocol_4", protocol_four());
  seed("pickle", "training", training);
  seed("pickle", "containers", pickle("](NK\x01\x85)\x88\x89\x86\x8a\x03\x01\x02\x03(K\x01K\x02te}N]sa"));
  seed("pickle", "system", pickle(global("os", "system") + tuple({unicode("id")}) + "R"));

  const std::string data(24, '\x3f');
  const std::string views = pickle(
      dict({unicode("w"), tensor(six, 0, {2, 3}, {3, 1}), unicode("t"), tensor(six, 0, {3, 2}, {1, 3})}));
  for (const auto& [name, method] :
       {std::pair{"stored", ZIP_CM_STORE}, std::pair{"deflated", ZIP_CM_DEFLATE}}) {
    seed("torch_checkpoint", name,
         zip_of({{"m/data.pkl", views, method},
                 {"m/byteorder", "little", method},
                 {"m/data/0", data, method},
                 {"m/version", "3\n", method}}));
  }
  seed("torch_checkpoint", "training", zip_of({{"m/data.pkl", training}, {"m/data/0", data}}));
  seed("torch_checkpoint", "script", zip_of({{"m/data.pkl", views}, {"m/constants.pkl", "\x80\x02)."}}));
  seed("torch_checkpoint", "bzip2", zip_of({{"m/data.pkl", views, ZIP_CM_BZIP2}}));
  seed("torch_checkpoint", "legacy", "\x80\x02\x8a\x0a\x6c\xfc\x9c\x46\xf9\x20\x6a\xa8\x50\x19.");
}
