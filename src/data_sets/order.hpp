// Which shape a sample uses: random orders that need no table.
#pragma once

#include <cstdint>
#include <string_view>

namespace bitr::data {

/// Where `index` goes in a random order of 0 … count − 1 that depends on the key alone: a swap-or-not shuffle
/// (Hoang, Morris and Rogaway, CRYPTO 2012), which never needs the others' places.
std::uint64_t shuffled(std::uint64_t index, std::uint64_t count, std::uint64_t key);

/// FNV-1a over the bytes, scattered; uniform over 64 bits.
std::uint64_t hash(std::string_view bytes);

/// The hash as a number in [0, 1).
double fraction(std::uint64_t hash);

}  // namespace bitr::data
