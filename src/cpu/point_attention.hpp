// The row-by-row evaluation of point_attention, shared with mean_direction.
#pragma once

#include "cpu/kernel.hpp"

namespace bitr::cpu {

/// A small dense matrix whose products run along its longer side.
template <class T>
class SmallMatrix {
 public:
  SmallMatrix() = default;
  template <class Derived>
  explicit SmallMatrix(const Eigen::MatrixBase<Derived>& matrix)
      : rows_(matrix.rows()),
        cols_(matrix.cols()),
        wide_(cols_ > rows_),
        values_(static_cast<std::size_t>(matrix.size())) {
    for (Eigen::Index r = 0; r < rows_; ++r)
      for (Eigen::Index c = 0; c < cols_; ++c) values_[at(r, c)] = static_cast<T>(matrix(r, c));
  }
  bool empty() const { return values_.empty(); }

  /// y += M x; entries of y are `stride` apart.
  void add_product(const T* x, T* y, Eigen::Index stride = 1) const { add_columns(cols_, x, y, stride); }
  /// y += M [x ; 1]
  void add_affine(const T* x, T* y) const {
    add_columns(cols_ - 1, x, y, 1);
    for (Eigen::Index r = 0; r < rows_; ++r) y[r] += values_[at(r, cols_ - 1)];
  }

 private:
  std::size_t at(Eigen::Index r, Eigen::Index c) const {
    return static_cast<std::size_t>(wide_ ? r * cols_ + c : c * rows_ + r);
  }
  void add_columns(Eigen::Index columns, const T* x, T* y, Eigen::Index stride) const {
    using Column = Eigen::Array<T, Eigen::Dynamic, 1>;
    if (wide_) {
      const Eigen::Map<const Column> factors(x, columns);
      for (Eigen::Index r = 0; r < rows_; ++r)
        y[r * stride] += (Eigen::Map<const Column>(values_.data() + r * cols_, columns) * factors).sum();
    } else {
      for (Eigen::Index c = 0; c < columns; ++c)
        for (Eigen::Index r = 0; r < rows_; ++r)
          y[r * stride] += x[c] * values_[static_cast<std::size_t>(c * rows_ + r)];
    }
  }

  Eigen::Index rows_ = 0, cols_ = 0;
  bool wide_ = false;
  std::vector<T> values_;
};

/// Coefficients of one cloud (or of all) in T.
template <class T>
struct PointCoefficients {
  SmallMatrix<T> M0, M1, O0, O1, S0, S1, Mz0, Mz1, Oz0, Oz1;

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
  const T* neighbors;
  T* out;
};

/// Evaluates rows [begin, end).
template <class T>
void point_attention_rows(const ops::PointAttention& op, const PointCoefficients<T>& coefficients,
                          const RowMatrix<T>& plane, const PointInputs<T>& inputs, int k, std::size_t begin,
                          std::size_t end);

}  // namespace bitr::cpu
