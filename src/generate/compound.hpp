// Solids put together from primitives: some added, some taken away.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "generate/primitive.hpp"
#include "generate/shape.hpp"

namespace bitr::generate {

/// The union of the primitives that were added without those that were taken away. Its surface is the outer one:
/// what of a primitive lies within another is not on it.
class Compound : public Shape {
 public:
  void add(std::unique_ptr<Primitive> primitive) {
    members_.push_back({std::move(primitive), false, {}, {}});
  }
  void take_away(std::unique_ptr<Primitive> primitive) {
    members_.push_back({std::move(primitive), true, {}, {}});
  }
  /// Once every primitive is there: moves `middle` (the bounding box's, if none is given) to the origin and scales
  /// everything to fit in the ball of solid_radius.
  void finish(std::optional<Eigen::Vector3d> middle = {});
  void set_symmetry(const Symmetry& symmetry) { symmetry_ = symmetry; }

  bool inside(const Eigen::Vector3d& at) const override;
  double weight() const override { return cells_.back().weight_up_to * scale_ * scale_; }
  void trial(Random& random, std::vector<SurfacePoint>& points) const override;
  Symmetry symmetry() const override { return symmetry_; }

 private:
  struct Box {
    Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity()), high = -low;
    void include(const Eigen::Vector3d& at) {
      low = low.cwiseMin(at);
      high = high.cwiseMax(at);
    }
    bool contains(const Eigen::Vector3d& at) const {
      return (at.array() >= low.array()).all() && (at.array() <= high.array()).all();
    }
    bool meets(const Box& other) const {
      return (low.array() <= other.high.array()).all() && (other.low.array() <= high.array()).all();
    }
  };
  struct Member {
    std::unique_ptr<Primitive> primitive;
    bool hollow;
    Box box;
    std::vector<std::uint16_t> around;  ///< the members whose boxes meet this one's
    bool contains(const Eigen::Vector3d& at) const { return box.contains(at) && primitive->contains(at); }
  };
  struct Cell {
    double weight_up_to;  ///< the sum over all cells so far, in the primitives' units
    std::uint16_t member, row, column;
  };
  /// The grid of a primitive, row by row; with it come its box and its cells.
  std::vector<Eigen::Vector3d> measure(std::size_t member);
  /// A cell with a probability in proportion to its own weight, for a number uniform in [0, 1).
  std::size_t pick(double share) const;
  bool exposed(const Eigen::Vector3d& at, std::size_t member) const;

  std::vector<Member> members_;
  std::vector<Cell> cells_;
  std::vector<std::uint32_t> guide_;  ///< which cell to look from, for evenly spaced shares of the weight
  Eigen::Vector3d middle_ = Eigen::Vector3d::Zero();
  double scale_ = 1;
  Symmetry symmetry_;
};

}  // namespace bitr::generate
