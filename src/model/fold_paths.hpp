// How the paths of ops/point_attention.hpp come out of a one-sided layer's radial networks: shared by the
// fold and its gradient.
#pragma once

#include "ops/convolve.hpp"

namespace bitr::model {

Eigen::VectorXd leaky(const Eigen::VectorXd& x);
/// Its slope at each x.
Eigen::ArrayXd leaky_slopes(const Eigen::VectorXd& x);
Eigen::VectorXd layer_norm(const Eigen::VectorXd& x, const Eigen::VectorXd& gain, const Eigen::VectorXd& bias,
                           double eps);

/// Channels of [values ; keys] (rows) from the paths of φ, and of φᶻ (columns), of one degree out.
struct PathMatrix {
  Eigen::MatrixXd edge, zero;
};
struct PathMatrices {
  PathMatrix degree0, degree1;
};
PathMatrices path_matrices(const ops::Convolve& convolve);

/// Where one number of a radial network goes.
struct PathEntry {
  Eigen::Index radial;       ///< among the network's outputs
  Eigen::Index row, column;  ///< where in PathMatrix::edge
  double zero_factor;        ///< its factor in PathMatrix::zero at (row, zero_column); 0: nowhere
  Eigen::Index zero_column;
};

template <class Visit>
void for_each_path(const ops::RadialBlock& block, const irreps::Fiber& in, Visit visit) {
  constexpr irreps::Degree scalar{0, 0}, vector{1, 0};
  const int c0 = in.channels(scalar), c1 = in.channels(vector);
  for (int o = 0; o < block.out_channels; ++o)
    for (int i = 0; i < block.in_channels; ++i)
      for (int J = 0; J < block.freq(); ++J) {
        const bool survives = block.in == block.out && J == 0;
        // K₀ of 1→1 is −1/√3.
        const double factor = !survives ? 0 : block.in == scalar ? 1 : -0.57735026918962576451;
        visit(PathEntry{(o * block.in_channels + i) * block.freq() + J, o,
                        (block.in == scalar ? 0 : c0) + J * c1 + i, factor, i});
      }
}

}  // namespace bitr::model
