// Independent random streams from one seed, so that what one draws does not shift what another does.
#pragma once

#include <cstdint>

#include "core/random.hpp"

namespace bitr::generate {

/// A bijection that scatters (the finaliser of SplitMix64).
inline std::uint64_t scatter(std::uint64_t bits) {
  bits = (bits ^ (bits >> 30)) * 0xbf58476d1ce4e5b9ULL;
  bits = (bits ^ (bits >> 27)) * 0x94d049bb133111ebULL;
  return bits ^ (bits >> 31);
}

inline std::uint64_t mix(std::uint64_t a, std::uint64_t b) {
  return scatter(scatter(a) + 0x9e3779b97f4a7c15ULL * (b + 1));
}

/// What a seed is drawn for.
enum class Draw : std::uint64_t { shape, points, cut, poses, noise, recipe, roughness };

inline Random random_for(std::uint64_t seed, Draw draw) {
  return Random(mix(seed, static_cast<std::uint64_t>(draw)));
}

}  // namespace bitr::generate
