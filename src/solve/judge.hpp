// What speaks for a pose and against it, looking from both clouds.
#pragma once

#include <bitr/pose.hpp>

#include "solve/level.hpp"

namespace bitr::solving {

/// How one cloud's points lie by the other, as shares of all its points.
struct Look {
  double fit = 0;       ///< each point by the distance of its counterpart and the angle of their normals
  double near = 0;      ///< with a counterpart within the reach
  double residual = 0;  ///< root mean square distance of those across the surface, in resolutions
  double cosine = 0;    ///< mean of those, of the normals up to sign
  double same = 0, opposite = 0;  ///< of those with like normals, of the points: the same side, or the other
  double conflict = 0;            ///< above the inside of the other cloud's surface, but off it
};
struct Fit {
  Look source, reference;
  /// Of both clouds together, as a share of the smaller's points, 1 for a copy; less where both have normals of
  /// their own and show each other now one side, now the other.
  double score = 0;
  double touching = 0;  ///< points of the cloud with fewer of them that have a counterpart
};
Fit fit(const Level& source, const Level& reference, const Pose& T, std::size_t every = 1);

/// How freely the surfaces slide or turn along each other at T: the best score, as a share of the pose's own, after
/// moving the points four resolutions in the ways that their normals resist least. 1 on a plane or a sphere.
double slack(const Level& source, const Level& reference, const Pose& T, double score);

}  // namespace bitr::solving
