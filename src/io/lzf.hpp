// LZF blocks, unpacked piece by piece.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>

namespace bitr::io {

struct LzfUnpacked {
  std::uint64_t bytes = 0;  ///< that were given away
  bool whole = false;       ///< all that was packed, and neither more nor fewer than `size`
};

/// Gives `take` the unpacked bytes in order, a piece at a time with its offset, up to `size` of them; stops
/// where the block is damaged. Holds about a mebibyte, however large the block.
LzfUnpacked unpack_lzf(
    std::span<const std::byte> packed, std::uint64_t size,
    const std::function<void(std::uint64_t offset, std::span<const std::byte> piece)>& take);

}  // namespace bitr::io
