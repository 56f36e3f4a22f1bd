// A cloud at one working resolution: evenly thinned, centred, with normals and a tree.
#pragma once

#include <Eigen/Core>
#include <bitr/cloud.hpp>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "core/point_tree.hpp"

namespace bitr::solving {

inline Eigen::Vector3d vector(const Vec3d& v) { return Eigen::Vector3d(v.data()); }
inline Vec3d row(const Eigen::Vector3d& v) { return {v[0], v[1], v[2]}; }

/// Points that stand for a cloud, and nothing else of it.
struct Thinned {
  std::vector<Vec3d> points;
  std::vector<Vec3d> normals;  ///< empty, or what the points' own normals add up to: unit, or zero
};

/// No two of the chosen are nearer than `apart`, and none of the cloud is farther from all: chosen from the
/// middle outwards, so that neither the frame nor the order of the points matters. Each is then the mean of the
/// points it is nearest to, which takes noise away.
Thinned thin(const Thinned& cloud, double apart);

struct Level {
  Level() = default;
  Level(const Level&) = delete;
  Level& operator=(const Level&) = delete;

  double resolution = 0;       ///< the thinning's distance, in the clouds' units
  std::vector<Vec3d> points;   ///< about the cloud's centroid
  std::vector<Vec3d> normals;  ///< one unit vector per point, of either sign
  std::vector<char> rim;       ///< whether the surface ends here
  bool given_normals = false;  ///< their signs are the cloud's own
  /// To be taken for the skin of a body that no other can be in: its normals point outwards, and another solid
  /// touches it from outside or not at all.
  bool solid = false;
  PointRows rows{points};
  std::unique_ptr<PointTree> tree;

  std::size_t size() const { return points.size(); }
};

/// The nearest point, if there is one within a distance.
class NearestWithin {
 public:
  using DistanceType = double;
  using IndexType = std::uint32_t;
  explicit NearestWithin(double squared) : squared_(squared) {}
  std::uint32_t index() const { return index_; }
  bool found() const { return index_ != std::numeric_limits<std::uint32_t>::max(); }
  double squared() const { return squared_; }

  // What nanoflann asks of a set of results.
  std::size_t size() const { return found(); }
  bool empty() const { return !found(); }
  bool full() const { return true; }
  double worstDist() const { return squared_; }
  bool addPoint(double squared, std::uint32_t index) {
    if (squared < squared_ || (squared == squared_ && index < index_)) {
      squared_ = squared;
      index_ = index;
    }
    return true;
  }
  void sort() {}

 private:
  double squared_;
  std::uint32_t index_ = std::numeric_limits<std::uint32_t>::max();
};

inline NearestWithin nearest_within(const Level& level, const Vec3d& from, double distance) {
  NearestWithin nearest(distance * distance);
  level.tree->findNeighbors(nearest, from.data(), {});
  return nearest;
}

}  // namespace bitr::solving
