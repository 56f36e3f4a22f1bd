// What cloud_coefficients and its gradient share.
#pragma once

#include <Eigen/Core>

namespace bitr::cpu {

/// A matrix on [own f⁰ ; appended f⁰ ; 1] as a matrix on [own f⁰ ; 1], the appended features being constants.
inline Eigen::MatrixXd condense(const Eigen::MatrixXd& full, int own, const Eigen::VectorXd& appended) {
  Eigen::MatrixXd condensed(full.rows(), own + 1);
  condensed.leftCols(own) = full.leftCols(own);
  condensed.col(own) = full.middleCols(own, appended.size()) * appended + full.rightCols<1>();
  return condensed;
}

}  // namespace bitr::cpu
