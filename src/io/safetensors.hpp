// The safetensors container: 8-byte header length, JSON header, one byte buffer without holes.
#pragma once

#include <bitr/result.hpp>
#include <span>
#include <string_view>

#include "core/tensor.hpp"

namespace bitr::io {

/// Parses a whole file. `bad_file` on a truncated or oversized header, junk JSON, an unknown dtype, a shape
/// whose product overflows or disagrees with its bytes, and offsets that overlap, leave holes or run past the
/// end.
Result<TensorMap> parse_safetensors(std::span<const std::byte> bytes, std::string_view name);

/// The file's bytes: tensors in name order, header padded with spaces to a multiple of 8. Names are UTF-8,
/// none is
/// "__metadata__", and every tensor holds as many bytes as its shape says.
std::vector<std::byte> serialize_safetensors(const TensorMap& map);

}  // namespace bitr::io
