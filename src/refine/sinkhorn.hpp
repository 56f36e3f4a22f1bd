// Entropic optimal transport between two clouds, each with a slack that takes what has no counterpart
// (log-domain Sinkhorn). The plan P_ij = exp(β(α − |a_i − b_j|²) + u_i + v_j) is never stored: its potentials
// are, and every pass over it is streamed in blocks of neighbouring points, leaving out blocks that cannot
// matter. Memory is O(N + M).
#pragma once

#include <Eigen/Core>
#include <bitr/cloud.hpp>
#include <bitr/pose.hpp>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "refine/workers.hpp"

namespace bitr::refine {

/// log affinity β(α − D²) of two points at distance D in all coordinates; 0 with the slack.
struct Affinity {
  double beta = 5000;   ///< 1 / units²
  double alpha = 0.49;  ///< units²
};

/// Points in blocks of neighbours, each block with its box.
class BlockedPoints {
 public:
  static constexpr std::size_t block = 64;

  /// `normals`: empty, or one per point; they count as three more coordinates, times `normal_length`.
  BlockedPoints(const std::vector<Vec3d>& points, const std::vector<Vec3d>& normals, double normal_length);
  std::size_t size() const { return order_.size(); }
  std::size_t blocks() const { return low_.size(); }
  /// Which of the points given is in row i.
  const std::vector<std::uint32_t>& order() const { return order_; }
  /// Moves the points (of the constructor), with their normals and boxes.
  void move(const Pose& pose);

  /// Coordinates of all rows, one column for each: x, y, z and the normal's.
  const Eigen::ArrayXXd& rows() const { return rows_; }
  const Vec3d& low(std::size_t b) const { return low_[b]; }
  const Vec3d& high(std::size_t b) const { return high_[b]; }
  std::size_t bytes() const;

 private:
  void measure();
  std::vector<std::uint32_t> order_;
  Eigen::ArrayXXd at_rest_, rows_;
  std::vector<Vec3d> low_, high_;
};

struct SinkhornOptions {
  int most_iterations = 200;
  double tolerance = 1e-5;  ///< stop when Σ |change of P| is less
};

class Sinkhorn {
 public:
  Sinkhorn(BlockedPoints source, BlockedPoints reference, const Workers& workers);

  void move_source(const Pose& pose) { source_.move(pose); }
  /// Alternately makes the rows of P and its slack sum to 1, and the columns. From u = v = 0, or from where
  /// it was when `warm`. Returns the iterations.
  int normalise(const Affinity& affinity, const SinkhornOptions& options, bool warm = false);

  /// weights_i = Σ_j P_ij and targets_i = Σ_j P_ij y_j, with all its coordinates, of every source row.
  void project(Eigen::ArrayXd& weights, Eigen::ArrayXXd& targets) const;
  /// P_ij of points as they were given.
  double log_plan(std::size_t source, std::size_t reference) const;

  const BlockedPoints& source() const { return source_; }
  const BlockedPoints& reference() const { return reference_; }
  /// v, in the order of the reference's rows: where a warm start begins.
  Eigen::ArrayXd& column_potentials() { return v_; }
  std::size_t bytes() const;

 private:
  /// visit(row, first column, P of the row in a block), for the blocks that matter.
  template <class Visit>
  void for_each_row(const Visit& visit) const;
  double change_of_plan(const Eigen::ArrayXd& old_rows, const Eigen::ArrayXd& old_columns) const;

  Workers workers_;
  BlockedPoints source_, reference_;
  Affinity affinity_;
  Eigen::ArrayXd u_, v_;
};

}  // namespace bitr::refine
