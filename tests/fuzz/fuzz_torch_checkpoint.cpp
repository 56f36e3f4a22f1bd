// Each input runs as it is, and once more with the checksums of its stored entries made right: else nearly
// every change would end at the first entry read.
#include <algorithm>
#include <cstdint>

#include "io/torch_checkpoint.hpp"

namespace {

std::uint32_t crc32(std::span<const std::uint8_t> bytes) {
  std::uint32_t crc = ~0u;
  for (const std::uint8_t byte : bytes) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ (crc & 1 ? 0xedb88320 : 0);
  }
  return ~crc;
}

std::size_t number(std::span<const std::uint8_t> bytes, std::size_t at, int width) {
  std::size_t value = 0;
  for (int i = 0; i < width; ++i) value |= std::size_t{bytes[at + i]} << 8 * i;
  return value;
}

void repair(std::span<std::uint8_t> bytes) {
  constexpr std::uint8_t signature[] = {'P', 'K', 1, 2};
  constexpr std::size_t central = 46, local = 30;
  for (std::size_t i = 0; i + central <= bytes.size(); ++i) {
    if (!std::equal(signature, signature + 4, &bytes[i]) || number(bytes, i + 10, 2) != 0) continue;
    const std::size_t size = number(bytes, i + 20, 4);
    const std::size_t header = number(bytes, i + 42, 4);
    if (header + local > bytes.size()) continue;
    const std::size_t data = header + local + number(bytes, header + 26, 2) + number(bytes, header + 28, 2);
    if (data + size > bytes.size()) continue;
    const std::uint32_t crc = crc32(bytes.subspan(data, size));
    for (int k = 0; k < 4; ++k) {
      bytes[i + 16 + k] = bytes[header + 14 + k] = static_cast<std::uint8_t>(crc >> 8 * k);
    }
  }
}

void parse(std::span<const std::uint8_t> bytes) {
  const auto map = bitr::io::parse_torch_checkpoint(std::as_bytes(bytes), "fuzz.pt");
  if (!map) return;
  for (const auto& [name, tensor] : map->tensors) {
    if (tensor.bytes.size() != tensor.size() * size_of(tensor.type)) __builtin_trap();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  parse({data, size});
  std::vector<std::uint8_t> repaired(data, data + size);
  repair(repaired);
  parse(repaired);
  return 0;
}
