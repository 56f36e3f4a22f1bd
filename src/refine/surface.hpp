// A cloud made ready to be searched: centred, with its spacing and, where it has them, its normals.
#pragma once

#include <algorithm>
#include <bitr/assemble.hpp>
#include <bitr/cloud.hpp>
#include <bitr/pose.hpp>
#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "core/point_tree.hpp"

namespace bitr::refine {

struct Surface {
  Vec3d centroid{};            ///< the points' centroid as given
  std::vector<Vec3d> points;   ///< less the centroid
  std::vector<Vec3d> normals;  ///< empty, or one unit vector per point
  std::vector<std::uint32_t>
      some;  ///< an even sample of at most `most_asked` points: those that look for others
  PointRows rows{points};
  PointTree tree;
  double spacing = 0;  ///< see median_spacing()
  std::size_t tree_bytes = 0;

  /// More points than this do not make a pose better, only later.
  static constexpr std::size_t most_asked = 10'000;

  explicit Surface(const CloudView& cloud);
  Surface(const Surface&) = delete;
  Surface& operator=(const Surface&) = delete;
  bool has_normals() const { return !normals.empty(); }
  std::size_t bytes() const;
  /// The spacing after thinning out to that many points; a surface's grows with the root of the number.
  double thinned_spacing(std::size_t most) const {
    return spacing * std::sqrt(std::max(1.0, static_cast<double>(points.size()) / static_cast<double>(most)));
  }
};

/// Throws `invalid_argument` for a cloud that is none: fewer than 3 points, numbers that are not finite,
/// normals that are not one per point; the message names pair and cloud.
void require_surfaces(std::span<const CloudPair> pairs);
/// How a message begins that is about one of several pairs; empty when there is one.
std::string pair_name(std::size_t pair, std::size_t pairs);

/// With one side's normals alone there is nothing to compare: then neither has any.
void keep_common_normals(Surface& source, Surface& reference);

/// A pose of the clouds as given, from the centred source to the centred reference.
Pose centred(const Pose& T_reference_source, const Surface& source, const Surface& reference);

}  // namespace bitr::refine
