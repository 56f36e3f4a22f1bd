// Whatever parses is written, read again and found equal.
#include <cstdint>

#include "io/safetensors.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace bitr::io;
  const auto map = parse_safetensors(std::as_bytes(std::span(data, size)), "fuzz.safetensors");
  if (!map) return 0;
  const auto again = parse_safetensors(serialize_safetensors(*map), "again.safetensors");
  if (!again || again->metadata != map->metadata || again->tensors.size() != map->tensors.size())
    __builtin_trap();
  for (const auto& [name, tensor] : map->tensors) {
    const auto other = again->tensors.find(name);
    if (other == again->tensors.end() || other->second.type != tensor.type ||
        other->second.shape != tensor.shape || other->second.bytes != tensor.bytes) {
      __builtin_trap();
    }
  }
  return 0;
}
