// Sizes and offsets in whole units.
#pragma once

#include <cstddef>

namespace bitr {

constexpr std::size_t aligned(std::size_t size, std::size_t unit) { return (size + unit - 1) / unit * unit; }

}  // namespace bitr
