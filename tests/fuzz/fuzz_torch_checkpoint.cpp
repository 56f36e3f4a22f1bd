#include <cstdint>

#include "io/torch_checkpoint.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto map = bitr::io::parse_torch_checkpoint(std::as_bytes(std::span(data, size)), "fuzz.pt");
  if (!map) return 0;
  for (const auto& [name, tensor] : map->tensors) {
    if (tensor.bytes.size() != tensor.size() * size_of(tensor.type)) __builtin_trap();
  }
  return 0;
}
