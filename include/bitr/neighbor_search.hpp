// How nearest neighbours are looked for.
#pragma once

#include <cstdint>

namespace bitr {

/// For neighbours of a cloud's points in that cloud. All ways are exact and give the same neighbours in the
/// same order, so that results have the same bits; they differ in time and memory. Searches of other kinds
/// (key points in a cloud, pairs of key points) choose for themselves.
enum class NeighborSearch : std::uint8_t {
  /// The faster one.
  /// On the CPU: a tree for clouds of more than 200 points.
  /// On a Vulkan device: a tree for every cloud of a batch whose largest has 4096 points or more.
  automatic,
  brute_force,  ///< every point against every other: time grows with the square of the points
  tree,         ///< a k-d tree on the CPU, boxes along a Morton curve on a Vulkan device
};

}  // namespace bitr
