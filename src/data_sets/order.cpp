#include "data_sets/order.hpp"

#include <algorithm>

#include "generate/seeds.hpp"

namespace bitr::data {

using generate::mix;

std::uint64_t shuffled(std::uint64_t index, std::uint64_t count, std::uint64_t key) {
  constexpr std::uint64_t rounds = 48;
  for (std::uint64_t round = 0; round < rounds; ++round) {
    const std::uint64_t round_key = mix(key, round);
    const std::uint64_t partner = (round_key % count + count - index) % count;
    if (mix(round_key, std::max(index, partner)) & 1) index = partner;
  }
  return index;
}

std::uint64_t hash(std::string_view bytes) {
  std::uint64_t value = 0xcbf29ce484222325ULL;
  for (const char byte : bytes) value = (value ^ static_cast<unsigned char>(byte)) * 0x100000001b3ULL;
  return generate::scatter(value);
}

double fraction(std::uint64_t hash) { return static_cast<double>(hash >> 11) * 0x1p-53; }

}  // namespace bitr::data
