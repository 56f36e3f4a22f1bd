// A pickle machine that cannot run code: of Python's virtual machine it keeps what `torch.save` needs to
// write down numbers, strings, containers and tensors, and refuses the rest by name.
#pragma once

#include <bitr/result.hpp>
#include <cstdint>
#include <span>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "core/tensor.hpp"

namespace bitr::io::pickle {

/// Values are numbered in the order they are built and refer to each other by number, so neither cycles nor
/// deep nesting cost more than their bytes in the file.
using Id = std::uint32_t;

struct None {};
struct List {
  Id index;  ///< into Document::lists
};
struct Dict {
  Id index;      ///< into Document::dicts
  bool ordered;  ///< a collections.OrderedDict
};
struct Tuple {
  Id begin, count;  ///< a range of Document::tuple_items
};
/// The only globals there are: two functions of torch._utils, one container and the classes of storages.
struct Global {
  enum class Kind : std::uint8_t { ordered_dict, rebuild_tensor, rebuild_parameter, storage };
  Kind kind;
  DType type = DType::f32;  ///< a storage's
};
struct StorageRef {
  Id index;  ///< into Document::storages
};
struct TensorRef {
  Id index;  ///< into Document::tensors
};

using Value = std::variant<None, bool, std::int64_t, double, std::string_view, List, Dict, Tuple, Global,
                           StorageRef, TensorRef>;

/// `size` elements of one type that lie elsewhere under `key`; both are the pickle's word alone.
struct Storage {
  DType type;
  std::string_view key;
  std::uint64_t size;
};

/// Element (i, j, …) of a tensor is element offset + i·strides[0] + j·strides[1] + … of its storage. Checked:
/// the tuples have the same length, at most 64, hold integers ≥ 0, every index is below the storage's size,
/// and the tensor has at most as many elements as the storage.
struct View {
  Id storage;  ///< into Document::storages
  std::uint64_t offset;
  Tuple shape;
  Tuple strides;
  std::uint64_t size;  ///< product of the shape
};

struct Document {
  std::vector<Value> values;
  std::vector<std::vector<Id>> lists;
  std::vector<std::vector<std::pair<Id, Id>>> dicts;  ///< key, value in the file's order; keys may repeat
  std::vector<Id> tuple_items;
  std::vector<Storage> storages;
  std::vector<View> tensors;
  Id root = 0;

  std::span<const Id> items(Tuple tuple) const {
    return std::span(tuple_items).subspan(tuple.begin, tuple.count);
  }
  /// The value as T, or null when it is of another kind.
  template <class T>
  const T* get(Id id) const {
    return std::get_if<T>(&values[id]);
  }
};

/// Runs a whole pickle, protocols 2 to 5. Strings point into `bytes`, which must outlive the document.
/// `bad_file` names the byte and the opcode, global or limit: 64 MiB, 4,194,304 values, 1,048,576 on the
/// stack, 1,000 marks.
Result<Document> parse(std::span<const std::byte> bytes, std::string_view name);

/// "an integer", "a tensor", …: what a message calls this value.
std::string_view kind_name(const Value& value);

}  // namespace bitr::io::pickle
