// The pickle machine without an archive's checksums in the way: any storage of up to 64 KiB is there.
#include <cstdint>

#include "io/safetensors.hpp"
#include "io/state_dict.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace bitr;
  static const std::vector<std::byte> storages(1 << 16, std::byte{1});
  const auto document = io::pickle::parse(std::as_bytes(std::span(data, size)), "fuzz.pkl");
  if (!document) return 0;
  // An allocation of exactly this size lets a sanitizer see a view that reaches past its storage.
  std::vector<std::byte> exact;
  const auto storage = [&](std::string_view, std::uint64_t bytes) -> Result<std::span<const std::byte>> {
    if (bytes > storages.size()) return fail(ErrorCode::bad_file, "too large");
    exact.assign(storages.begin(), storages.begin() + static_cast<std::ptrdiff_t>(bytes));
    exact.shrink_to_fit();
    return exact;
  };
  const auto map = io::gather_state_dict(*document, storage, 1 << 20, "fuzz.pkl");
  if (!map) return 0;
  const auto again = io::parse_safetensors(io::serialize_safetensors(*map), "fuzz.safetensors");
  if (!again || again->tensors.size() != map->tensors.size()) __builtin_trap();
  return 0;
}
