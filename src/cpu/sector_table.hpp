// Evaluates ops::SectorTable edge by edge.
#pragma once

#include "cpu/radial.hpp"
#include "ops/sector_table.hpp"

namespace bitr::cpu {

template <class T>
class Sectors {
 public:
  explicit Sectors(const ops::SectorTable& table);

  /// Adds this table's coefficients for lengths (r1, r2) ≥ 0; `coefficients` is the edge's whole vector.
  void add(T r1, T r2, T* coefficients) const;
  /// From the gradient of the edge's whole vector to those of the table's numbers (in the order of
  /// ops/constants.hpp) and of the lengths; adds to both. Edges that the network answers for have none.
  void add_gradient(T r1, T r2, const T* coefficients, T* table, T& d_r1, T& d_r2) const;

 private:
  std::size_t find(T r1, T r2) const;
  void add_network(T r1, T r2, T* to) const;

  int scale_degree_, size_;
  bool swapped_;
  int begin_;
  std::vector<T> ray_cos_, ray_sin_;
  Eigen::Array<T, Eigen::Dynamic, Eigen::Dynamic> slopes_;   ///< size × (sectors · 2 or 3)
  Eigen::Array<T, Eigen::Dynamic, Eigen::Dynamic> offsets_;  ///< size × sectors
  std::array<T, 3> q_;
  std::vector<std::array<T, 6>> Q_;
  T eps_, trusted_;  ///< the network is evaluated where q(ρ) ≤ trusted
  Radial<T> network_;
  Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic> basis_;  ///< scale included
};

}  // namespace bitr::cpu
