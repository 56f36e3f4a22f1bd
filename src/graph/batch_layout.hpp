// How a ragged batch of pairs is laid out in rows. Clouds are ordered: every source, then every reference.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace bitr::graph {

/// What a tensor has one row (or a fixed number of rows) of.
enum class Rows : std::uint8_t {
  point,     ///< every point of every cloud
  cloud,     ///< every cloud
  key,       ///< every key point of every cloud
  pair,      ///< every pair
  pair_key,  ///< every pair of key points: a node of the 6-D graph
  one,       ///< the batch
};

struct BatchLayout {
  std::vector<std::uint32_t> cloud_offset = {0};  ///< 2·pairs + 1 entries: cloud c owns point rows [c], [c+1]
  std::uint32_t key_points = 0;                   ///< per cloud
  std::vector<std::uint32_t> key_offset;          ///< where clouds differ in that: clouds + 1 entries

  BatchLayout() = default;
  /// `cloud_sizes`: points of every source, then of every reference.
  BatchLayout(std::span<const std::uint32_t> cloud_sizes, std::uint32_t keys) : key_points(keys) {
    for (std::uint32_t size : cloud_sizes) cloud_offset.push_back(cloud_offset.back() + size);
  }

  bool operator==(const BatchLayout&) const = default;
  std::uint32_t clouds() const { return static_cast<std::uint32_t>(cloud_offset.size()) - 1; }
  std::uint32_t pairs() const { return clouds() / 2; }
  /// The other cloud of the same pair.
  std::uint32_t other(std::uint32_t cloud) const { return (cloud + pairs()) % clouds(); }

  std::size_t rows(Rows kind) const {
    switch (kind) {
      case Rows::point:
        return cloud_offset.back();
      case Rows::cloud:
        return clouds();
      case Rows::key:
        return begin(Rows::key, clouds());
      case Rows::pair:
        return pairs();
      case Rows::pair_key:
        return std::size_t{pairs()} * key_points;
      case Rows::one:
        return 1;
    }
    return 0;
  }
  /// Groups that never see each other: clouds, or pairs for the rows of the 6-D graph.
  std::uint32_t segments(Rows kind) const {
    return kind == Rows::pair || kind == Rows::pair_key ? pairs() : clouds();
  }
  /// First row of a segment; segment = segments(kind) gives the end.
  std::size_t begin(Rows kind, std::uint32_t segment) const {
    switch (kind) {
      case Rows::point:
        return cloud_offset[segment];
      case Rows::key:
        return key_offset.empty() ? std::size_t{segment} * key_points : key_offset[segment];
      case Rows::pair_key:
        return std::size_t{segment} * key_points;
      case Rows::cloud:
      case Rows::pair:
      case Rows::one:
        return segment;
    }
    return 0;
  }
};

}  // namespace bitr::graph
