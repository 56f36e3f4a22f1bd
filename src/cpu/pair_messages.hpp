// Messages of a two-sided layer in the edges' own frames (ops/pair_attention.hpp), one edge per lane.
#pragma once

#include <vector>

#include "cpu/kernel.hpp"

namespace bitr::cpu {

/// coefficient · input component → output component, in the edge's frames.
struct Term {
  int coefficient, out, in;
  bool negative;
};

/// Axis to axis; then identity and 𝒥 on the plane across it.
inline std::vector<Term> side_terms(int in, int out) {
  std::vector<Term> terms = {{0, 0, 0, false}};
  if (in == 1 && out == 1)
    terms.insert(terms.end(), {{1, 1, 1, false}, {1, 2, 2, false}, {2, 1, 2, true}, {2, 2, 1, false}});
  return terms;
}

/// The tensor product of both sides' terms.
inline std::vector<Term> pair_terms(const ops::PairBlock& block) {
  const int freq2 = 2 * std::min(block.in.q, block.out.q) + 1, out2 = 2 * block.out.q + 1,
            in2 = 2 * block.in.q + 1;
  std::vector<Term> terms;
  for (const Term& a : side_terms(block.in.p, block.out.p))
    for (const Term& b : side_terms(block.in.q, block.out.q))
      terms.push_back({a.coefficient * freq2 + b.coefficient, a.out * out2 + b.out, a.in * in2 + b.in,
                       a.negative != b.negative});
  return terms;
}

/// Rows of an orthonormal, right-handed frame whose first axis is the edge's direction.
template <class Edges>
struct Frame {
  Edges rows[3][3];

  /// d: the edge's vector. The angle about the axis cancels in the messages; so does the whole frame where
  /// the length is zero.
  void set(const Edges* d, const Edges& length) {
    const auto positive = length > 0;
    const Edges scale = positive.select(length.inverse(), Edges::Zero());
    const Edges x = d[0] * scale, y = d[1] * scale, z = positive.select(d[2] * scale, Edges::Ones());
    const Edges sign = (z >= 0).select(Edges::Ones(), -Edges::Ones());
    const Edges a = -(sign + z).inverse(), b = x * y * a;
    rows[0][0] = x, rows[0][1] = y, rows[0][2] = z;
    rows[1][0] = 1 + sign * x * x * a, rows[1][1] = sign * b, rows[1][2] = -sign * x;
    rows[2][0] = b, rows[2][1] = sign + y * y * a, rows[2][2] = -y;
  }
  /// A vector, its components `step` apart, into the frame or back.
  void turn(Edges* v, int step, bool into) const {
    const Edges x = v[0], y = v[step], z = v[2 * step];
    for (int i = 0; i < 3; ++i)
      v[i * step] = into ? Edges(rows[i][0] * x + rows[i][1] * y + rows[i][2] * z)
                         : Edges(rows[0][i] * x + rows[1][i] * y + rows[2][i] * z);
  }
};

/// Turns every vector of a row of features into the frames of the two sides, or back.
template <class Edges>
void turn(const irreps::Fiber& fiber, const Frame<Edges> (&frames)[2], Edges* row, bool into) {
  for (const auto& [d, m] : fiber)
    for (int c = 0; c < m; ++c, row += d.dim()) {
      const int inner = 2 * d.q + 1;
      if (d.p == 1)
        for (int j = 0; j < inner; ++j) frames[0].turn(row + j, inner, into);
      if (d.q == 1)
        for (int i = 0; i < 2 * d.p + 1; ++i) frames[1].turn(row + 3 * i, 1, into);
    }
}

/// Adds one block's messages. in, out: the rows of the two degrees; coefficients: (freq, out_channels,
/// in_channels).
template <class Edges>
void add_messages(const ops::PairBlock& block, const std::vector<Term>& terms, const Edges* coefficients,
                  const Edges* in, Edges* out) {
  const int dim_in = block.in.dim(), dim_out = block.out.dim();
  for (int o = 0; o < block.out_channels; ++o)
    for (const Term& term : terms) {
      const Edges* weight = coefficients + (term.coefficient * block.out_channels + o) * block.in_channels;
      Edges sum = weight[0] * in[term.in];
      for (int i = 1; i < block.in_channels; ++i) sum += weight[i] * in[i * dim_in + term.in];
      Edges& target = out[o * dim_out + term.out];
      if (term.negative)
        target -= sum;
      else
        target += sum;
    }
}

}  // namespace bitr::cpu
