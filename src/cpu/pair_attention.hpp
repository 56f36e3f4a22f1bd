// The row-by-row evaluation of pair_attention, shared with its gradient.
#pragma once

#include <algorithm>
#include <cmath>
#include <map>

#include "cpu/pair_messages.hpp"
#include "cpu/projected_relu.hpp"
#include "cpu/sector_table.hpp"

namespace bitr::cpu {

/// Visits one side's part of a block's coefficients: whole(c) for each between different degrees, where that
/// side is J = 1; triple(c₀, c₁, c₂) for those of 1→1.
template <class T, class Whole, class Triple>
void visit_side(const ops::PairBlock& block, bool first_side, T* coefficients, Whole whole, Triple triple) {
  const int channels = block.in_channels * block.out_channels;
  const int freq1 = 2 * std::min(block.in.p, block.out.p) + 1,
            freq2 = 2 * std::min(block.in.q, block.out.q) + 1;
  const int in = first_side ? block.in.p : block.in.q, out = first_side ? block.out.p : block.out.q;
  T* at = coefficients + block.coefficients;
  if (in != out)
    for (int c = 0; c < freq1 * freq2 * channels; ++c) whole(at[c]);
  if (in != out || in == 0) return;
  const int step = (first_side ? freq2 : 1) * channels, others = first_side ? freq2 : freq1;
  const int other_step = (first_side ? 1 : freq2) * channels;
  for (int other = 0; other < others; ++other)
    for (int c = 0; c < channels; ++c) {
      T* value = at + other * other_step + c;
      triple(value[0], value[step], value[2 * step]);
    }
}

/// A direction shorter than 1 (ops::direction_eps) scales what depends on J by |v|^J, and length zero leaves
/// J = 0 only. Between different degrees that is J = 1; of 1→1 it is the identity's part (c₀ + 2c₁)/3, the
/// turn c₂, and the rest.
template <class T>
void shorten_direction(const ops::PairBlock& block, bool first_side, T norm, T* coefficients) {
  visit_side(
      block, first_side, coefficients, [&](T& c) { c *= norm; },
      [&](T& c0, T& c1, T& c2) {
        const T scalar = (c0 + 2 * c1) / 3;
        c0 = scalar + norm * norm * (c0 - scalar);
        c1 = scalar + norm * norm * (c1 - scalar);
        c2 *= norm;
      });
}

/// Its transpose.
template <class T>
void shorten_direction_gradient(const ops::PairBlock& block, bool first_side, T norm, T* coefficients) {
  visit_side(
      block, first_side, coefficients, [&](T& c) { c *= norm; },
      [&](T& c0, T& c1, T& c2) {
        const T scalar = (1 - norm * norm) * (c0 + c1) / 3;
        c0 = norm * norm * c0 + scalar;
        c1 = norm * norm * c1 + 2 * scalar;
        c2 *= norm;
      });
}

/// A two-sided layer's constants in T.
template <class T>
struct PairConstants {
  explicit PairConstants(const ops::PairAttention& source)
      : op(source),
        relu(source.fiber_out, source.planes, source.relu_square),
        messages(irreps::concatenate(source.value_fiber, source.key_fiber)) {
    for (const auto& table : op.tables) tables.emplace_back(table);
    for (const auto& block : op.blocks) terms.push_back(pair_terms(block));
    const auto cast = [](const ops::DegreeMatrices& from, std::map<irreps::Degree, RowMatrix<T>>& to) {
      for (const auto& [d, matrix] : from) to[d] = matrix.template cast<T>();
    };
    cast(op.query, query);
    cast(op.project, project);
    cast(op.self, self);
  }
  ops::PairAttention op;
  std::vector<Sectors<T>> tables;
  std::vector<std::vector<Term>> terms;
  std::map<irreps::Degree, RowMatrix<T>> query, project, self;
  RowRelu<T> relu;
  irreps::Fiber messages;  // [values ; keys] per degree
};

/// One node of the 6-D graph, its edges one lane each (Width ≥ k lanes; the rest carry no weight).
template <class T, int Width>
class PairRow {
 public:
  using Edges = Lanes<T, Width>;

  PairRow(const PairConstants<T>& prepared, int k)
      : p_(prepared),
        k_(k),
        coefficient_(p_.op.coefficient_count),
        edges_(static_cast<std::size_t>(k) * p_.op.coefficient_count),
        feature_(p_.op.fiber_in.size()),
        message_(p_.messages.size()),
        weight_(p_.op.heads),
        query_(p_.op.key_fiber.size()),
        sum_(p_.op.value_fiber.size()),
        result_(p_.op.fiber_out.size()) {}

  void evaluate(const T* features, const std::uint32_t* neighbors, const T* positions, std::size_t row,
                T* out) {
    const T* own = features + row * feature_.size();
    gather(features, neighbors, positions, row);
    messages();
    attend(own);
    project(own, result_.data());
    if (p_.op.relu) p_.relu.apply(result_.data());
    std::copy(result_.begin(), result_.end(), out);
  }

 protected:
  using Buffer = std::vector<Edges, Eigen::aligned_allocator<Edges>>;
  // Where Eigen writes: it starts its vectors at aligned addresses, so the address would show in the last
  // bit.
  using Numbers = std::vector<T, Eigen::aligned_allocator<T>>;

  // Leaves features in the edges' frames, messages out of them.
  void messages() {
    turn(p_.op.fiber_in, frame_, feature_.data(), true);
    for (Edges& m : message_) m.setZero();
    for (std::size_t b = 0; b < p_.op.blocks.size(); ++b) {
      const ops::PairBlock& block = p_.op.blocks[b];
      add_messages(block, p_.terms[b], &coefficient_[block.coefficients],
                   &feature_[p_.op.fiber_in.offset(block.in)],
                   &message_[p_.messages.offset(block.out) + block.out_begin * block.out.dim()]);
    }
    turn(p_.messages, frame_, message_.data(), false);
  }

  void gather(const T* features, const std::uint32_t* neighbors, const T* positions, std::size_t row) {
    const T* centre = positions + 6 * row;
    Edges d[2][3];
    for (auto& side : d)
      for (Edges& component : side) component.setZero();
    if (k_ < Width) {
      for (Edges& f : feature_) f.setZero();
      for (Edges& c : coefficient_) c.setZero();
    }
    for (int j = 0; j < k_; ++j) {
      const T* at = positions + 6 * std::size_t{neighbors[j]};
      for (int s = 0; s < 2; ++s)
        for (int a = 0; a < 3; ++a) d[s][a][j] = centre[3 * s + (a + 1) % 3] - at[3 * s + (a + 1) % 3];
      const T* f = features + neighbors[j] * feature_.size();
      for (std::size_t c = 0; c < feature_.size(); ++c) feature_[c][j] = f[c];
    }
    for (int s = 0; s < 2; ++s) {
      length_[s] = (d[s][0].square() + d[s][1].square() + d[s][2].square()).sqrt();
      frame_[s].set(d[s], length_[s]);
    }
    std::fill(edges_.begin(), edges_.end(), T{0});
    // Table by table: together they do not fit a cache.
    for (const Sectors<T>& table : p_.tables)
      for (int j = 0; j < k_; ++j) table.add(length_[0][j], length_[1][j], edge(j));
    for (int j = 0; j < k_; ++j)
      for (int s = 0; s < 2; ++s)
        if (const T norm = length_[s][j] / static_cast<T>(ops::direction_eps); norm < 1)
          for (const auto& block : p_.op.blocks) shorten_direction(block, s == 0, norm, edge(j));
    for (std::size_t c = 0; c < coefficient_.size(); ++c)
      for (int j = 0; j < k_; ++j) coefficient_[c][j] = edge(j)[c];
  }

  T* edge(int j) { return edges_.data() + static_cast<std::size_t>(j) * coefficient_.size(); }

  void attend(const T* own) {
    const auto& op = p_.op;
    for (Edges& e : weight_) e.setZero();
    for (const auto& [d, keys] : op.key_fiber) {
      const RowMatrix<T>& matrix = p_.query.at(d);
      const int dim = d.dim(), values = op.value_fiber.channels(d), per_head = keys / op.heads;
      const Eigen::Map<const RowMatrix<T>> x(own + op.fiber_in.offset(d), matrix.cols(), dim);
      Eigen::Map<RowMatrix<T>> query(query_.data(), keys, dim);
      query = matrix.lazyProduct(x);
      const Edges* key = &message_[p_.messages.offset(d) + values * dim];
      for (int c = 0; c < keys; ++c)
        for (int m = 0; m < dim; ++m) weight_[c / per_head] += query(c, m) * key[c * dim + m];
    }
    for (Edges& e : weight_) {
      e = (e - e.head(k_).maxCoeff()).exp();
      e.tail(Width - k_).setZero();
      e /= e.sum();
    }
    for (const auto& [d, values] : op.value_fiber) {
      const int dim = d.dim(), per_head = values / op.heads;
      const Edges* value = &message_[p_.messages.offset(d)];
      T* sum = &sum_[op.value_fiber.offset(d)];
      for (int c = 0; c < values; ++c)
        for (int m = 0; m < dim; ++m) sum[c * dim + m] = (weight_[c / per_head] * value[c * dim + m]).sum();
    }
  }

  void project(const T* own, T* out) {
    const auto& op = p_.op;
    for (const auto& [d, m] : op.fiber_out) {
      const int dim = d.dim();
      const RowMatrix<T>& from_values = p_.project.at(d);
      Eigen::Map<RowMatrix<T>> to(out + op.fiber_out.offset(d), m, dim);
      to = from_values.lazyProduct(
          Eigen::Map<const RowMatrix<T>>(&sum_[op.value_fiber.offset(d)], from_values.cols(), dim));
      if (const auto self = p_.self.find(d); self != p_.self.end())
        to += self->second.lazyProduct(
            Eigen::Map<const RowMatrix<T>>(own + op.fiber_in.offset(d), self->second.cols(), dim));
    }
  }

  const PairConstants<T>& p_;
  const int k_;
  Frame<Edges> frame_[2];
  Edges length_[2];
  Buffer coefficient_;
  Numbers edges_;  // edge by edge, what coefficient_ holds coefficient by coefficient
  Buffer feature_, message_, weight_;
  Numbers query_, sum_, result_;
};

/// Calls work(width) with the first of the ascending numbers of lanes, as a constant, that holds k edges.
template <int... Widths, class Work>
void with_width(int k, Work work) {
  bool done = false;
  const auto try_width = [&]<int Width>(std::integral_constant<int, Width> width) {
    if (done || k > Width) return;
    work(width);
    done = true;
  };
  (try_width(std::integral_constant<int, Widths>()), ...);
}

}  // namespace bitr::cpu
