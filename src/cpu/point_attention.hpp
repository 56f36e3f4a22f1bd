// The row-by-row evaluation of point_attention, shared with mean_direction.
#pragma once

#include "cpu/kernel.hpp"

namespace bitr::cpu {

/// Coefficients of one cloud (or of all) in T, column-major so that they are added column by column.
template <class T>
struct PointCoefficients {
  using Matrix = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic>;
  Matrix M0, M1, O0, O1, S0, S1, Mz0, Mz1, Oz0, Oz1;

  PointCoefficients() = default;
  explicit PointCoefficients(const ops::PointAttention& op);
  /// Degree-0 matrices from a row of cloud_coefficients.
  PointCoefficients(const ops::PointAttention& op, const T* row);
};

template <class T>
struct PointInputs {
  const T* features;
  std::size_t feature_stride;  ///< 0: the same features for every point
  const std::uint32_t* index;
  const T* centres;
  const T* neighbours;
  T* out;
};

/// Evaluates rows [begin, end).
template <class T>
void point_attention_rows(const ops::PointAttention& op, const PointCoefficients<T>& coefficients,
                          const RowMatrix<T>& plane, const PointInputs<T>& inputs, int k, std::size_t begin,
                          std::size_t end);

}  // namespace bitr::cpu
