#include "io/state_dict.hpp"

#include <cstring>
#include <string>

#include "io/quote.hpp"

namespace bitr::io {
namespace {

using pickle::Dict;
using pickle::Document;
using pickle::Id;

/// The value of a text key; null without it.
const Id* find(const Document& document, const Dict& dict, std::string_view key) {
  for (const auto& [name, value] : document.dicts[dict.index]) {
    const auto* text = document.get<std::string_view>(name);
    if (text && *text == key) return &value;
  }
  return nullptr;
}

std::vector<std::size_t> numbers(const Document& document, pickle::Tuple tuple) {
  std::vector<std::size_t> values;
  for (const Id id : document.items(tuple))
    values.push_back(static_cast<std::size_t>(*document.get<std::int64_t>(id)));
  return values;
}

bool is_contiguous(const std::vector<std::size_t>& shape, const std::vector<std::size_t>& strides) {
  std::size_t expected = 1;
  for (std::size_t i = shape.size(); i-- > 0;) {
    if (shape[i] != 1 && strides[i] != expected) return false;
    expected *= shape[i];
  }
  return true;
}

/// Copies a view of at least one element into `tensor.bytes`, the last extent fastest.
void gather(const std::byte* first, const std::vector<std::size_t>& strides, Tensor& tensor) {
  const std::size_t width = size_of(tensor.type);
  if (is_contiguous(tensor.shape, strides)) {
    std::memcpy(tensor.bytes.data(), first, tensor.bytes.size());
    return;
  }
  std::vector<std::size_t> index(tensor.shape.size());
  std::size_t from = 0;
  for (std::size_t to = 0; to < tensor.bytes.size(); to += width) {
    std::memcpy(tensor.bytes.data() + to, first + from * width, width);
    for (std::size_t i = index.size(); i-- > 0;) {
      from += strides[i];
      if (++index[i] < tensor.shape[i]) break;
      from -= strides[i] * index[i];
      index[i] = 0;
    }
  }
}

}  // namespace

Result<TensorMap> gather_state_dict(const Document& document, const StorageReader& storage,
                                    std::uint64_t byte_limit, std::string_view name) {
  const auto refuse = [&](const std::string& why) {
    return fail(ErrorCode::bad_file, std::string(name) + ": " + why);
  };
  const auto kind = [&](Id id) { return std::string(kind_name(document.values[id])); };

  const Dict* dict = document.get<Dict>(document.root);
  if (!dict) return refuse("holds " + kind(document.root) + ", not a state dict");
  for (const std::string_view key : {"model_state_dict", "state_dict"}) {
    const Id* entry = find(document, *dict, key);
    if (!entry) continue;
    dict = document.get<Dict>(*entry);
    if (!dict) return refuse("entry " + in_quotes(key) + " is " + kind(*entry) + ", not a dict");
    break;
  }

  TensorMap map;
  std::uint64_t total = 0;
  for (const auto& [key, value] : document.dicts[dict->index]) {
    const auto* text = document.get<std::string_view>(key);
    if (!text) return refuse("a tensor's name is " + kind(key) + ", not text");
    const std::string label = "tensor " + in_quotes(*text);
    const auto* reference = document.get<pickle::TensorRef>(value);
    if (!reference) return refuse("entry " + in_quotes(*text) + " is " + kind(value) + ", not a tensor");
    if (*text == "__metadata__") return refuse(label + ": this name is reserved");

    const pickle::View& view = document.tensors[reference->index];
    const pickle::Storage& source = document.storages[view.storage];
    const std::size_t width = size_of(source.type);
    Tensor tensor{source.type, numbers(document, view.shape), {}};
    if (view.size != 0) {
      std::uint64_t storage_bytes = 0;
      if (__builtin_mul_overflow(source.size, width, &storage_bytes)) {
        return refuse(label + ": a storage of " + std::to_string(source.size) + " elements");
      }
      const auto bytes = storage(source.key, storage_bytes);
      if (!bytes) return refuse(label + ": " + bytes.error().message);
      total += view.size * width;
      if (total > byte_limit)
        return refuse(label + ": the tensors pass " + std::to_string(byte_limit) + " bytes");
      tensor.bytes.resize(view.size * width);
      gather(bytes->data() + view.offset * width, numbers(document, view.strides), tensor);
    }
    if (!map.tensors.emplace(*text, std::move(tensor)).second) return refuse(label + " appears twice");
  }
  return map;
}

}  // namespace bitr::io
