// From clouds as they are given to levels at one resolution.
#pragma once

#include <bitr/assemble.hpp>
#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "core/thread_pool.hpp"
#include "solve/level.hpp"
#include "solve/normals.hpp"

namespace bitr::solving {

/// A cloud about its centroid, without rows that are not finite.
struct Prepared {
  Vec3d centroid{};
  Thinned cloud;
  double spacing = 0;  ///< median distance to the nearest other place
  double grain =
      0;  ///< side of the square of surface that a point stands for, by the median point: a spacing
          ///< that does not shrink where points lie by chance
  double radius = 0;  ///< root of the mean squared distance from the centroid
  std::size_t dropped = 0;
  std::optional<Vec3d> viewpoint = {};  ///< about the centroid
};
Prepared prepare(const CloudView& cloud, const std::optional<Vec3d>& viewpoint = {});

/// The cloud thinned to about `most` points and no more, but nowhere closer than `least` apart.
struct Spread {
  Thinned cloud;
  double apart = 0;
};
Spread spread_to(const Prepared& cloud, std::size_t most, double least);

/// Both clouds at one resolution: the finest that both allow, with at most `most` points each.
struct LevelPair {
  Level source, reference;
  Neighbours near_source, near_reference;
};
std::unique_ptr<LevelPair> levels(const Prepared& source, const Prepared& reference, std::size_t most,
                                  double reach, std::size_t neighbours, ThreadPool& pool);

}  // namespace bitr::solving
