// Normals of a level: their directions from the points around, their signs by a rule.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/thread_pool.hpp"
#include "solve/level.hpp"

namespace bitr::solving {

/// The neighbours of every point of a level, itself left out: nearest first, no farther than a distance.
struct Neighbours {
  std::size_t most = 0;
  std::vector<std::uint32_t> index;  ///< points × most
  std::vector<float> distance;       ///< the same
  std::vector<std::uint32_t> count;  ///< of each point
};
Neighbours neighbours(const Level& level, double within, std::size_t most, ThreadPool& pool);

/// Fills the normals that are not unit vectors yet with the direction in which the points around spread least, and marks
/// the rim: points whose neighbours lie to one side. Where the viewpoint is known they point there, and the level's
/// signs are its own then; else they agree with the given normals around, if there are any.
void estimate_normals(Level& level, const Neighbours& near, const std::optional<Vec3d>& viewpoint,
                      ThreadPool& pool);

/// How signs are chosen. No rule is right for every cloud.
enum class Signs : std::uint8_t {
  given,    ///< the cloud's own
  outward,  ///< away from the centroid
  spread,   ///< neighbours agree, along a tree that crosses the flattest places; away from the centroid on
            ///< the whole
};
std::vector<Vec3d> signed_normals(const Level& level, const Neighbours& near, Signs signs);

}  // namespace bitr::solving
