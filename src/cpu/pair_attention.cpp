#include <algorithm>
#include <cmath>
#include <map>

#include "cpu/projected_relu.hpp"
#include "cpu/sector_table.hpp"

namespace bitr::cpu {
namespace {

using irreps::Degree;

// coefficient · input component → output component, in the edge's frames.
struct Term {
  int coefficient, out, in;
  bool negative;
};

// Axis to axis; then identity and 𝒥 on the plane across it.
std::vector<Term> side_terms(int in, int out) {
  std::vector<Term> terms = {{0, 0, 0, false}};
  if (in == 1 && out == 1)
    terms.insert(terms.end(), {{1, 1, 1, false}, {1, 2, 2, false}, {2, 1, 2, true}, {2, 2, 1, false}});
  return terms;
}

std::vector<Term> pair_terms(const ops::PairBlock& block) {
  const int freq2 = 2 * std::min(block.in.q, block.out.q) + 1, out2 = 2 * block.out.q + 1, in2 = 2 * block.in.q + 1;
  std::vector<Term> terms;
  for (const Term& a : side_terms(block.in.p, block.out.p))
    for (const Term& b : side_terms(block.in.q, block.out.q))
      terms.push_back({a.coefficient * freq2 + b.coefficient, a.out * out2 + b.out, a.in * in2 + b.in,
                       a.negative != b.negative});
  return terms;
}

// On a side of length zero only J = 0 survives: nothing between different degrees, and of 1→1 the multiple of the
// identity, which is (c₀ + 2c₁)/3.
template <class T>
void keep_scalar_part(const ops::PairBlock& block, bool first_side, T* coefficients) {
  const int channels = block.in_channels * block.out_channels;
  const int freq1 = 2 * std::min(block.in.p, block.out.p) + 1, freq2 = 2 * std::min(block.in.q, block.out.q) + 1;
  const int in = first_side ? block.in.p : block.in.q, out = first_side ? block.out.p : block.out.q;
  T* at = coefficients + block.coefficients;
  if (in != out) {
    std::fill_n(at, freq1 * freq2 * channels, T{0});
    return;
  }
  if (in == 0) return;
  const int step = (first_side ? freq2 : 1) * channels, others = first_side ? freq2 : freq1;
  const int other_step = (first_side ? 1 : freq2) * channels;
  for (int other = 0; other < others; ++other)
    for (int c = 0; c < channels; ++c) {
      T* value = at + other * other_step + c;
      value[0] = value[step] = (value[0] + 2 * value[step]) / 3;
      value[2 * step] = 0;
    }
}

template <class T>
struct Prepared {
  explicit Prepared(const ops::PairAttention& source)
      : op(source), relu(source.fiber_out, source.planes),
        messages(irreps::concatenate(source.value_fiber, source.key_fiber)) {
    for (const auto& table : op.tables) tables.emplace_back(table);
    for (const auto& block : op.blocks) terms.push_back(pair_terms(block));
    const auto cast = [](const ops::DegreeMatrices& from, std::map<Degree, RowMatrix<T>>& to) {
      for (const auto& [d, matrix] : from) to[d] = matrix.template cast<T>();
    };
    cast(op.query, query);
    cast(op.project, project);
    cast(op.self, self);
  }
  ops::PairAttention op;
  std::vector<Sectors<T>> tables;
  std::vector<std::vector<Term>> terms;
  std::map<Degree, RowMatrix<T>> query, project, self;
  RowRelu<T> relu;
  irreps::Fiber messages;  // [values ; keys] per degree
};

template <class T, int Width>
class PairRow {
 public:
  using Edges = Eigen::Array<T, Width, 1>;

  PairRow(const Prepared<T>& prepared, int k)
      : p_(prepared), k_(k), coefficient_(p_.op.coefficient_count), edge_(p_.op.coefficient_count),
        feature_(p_.op.fiber_in.size()), message_(p_.messages.size()), weight_(p_.op.heads),
        query_(p_.op.key_fiber.size()), sum_(p_.op.value_fiber.size()) {}

  void evaluate(const T* features, const std::uint32_t* neighbours, const T* positions, std::size_t row, T* out) {
    const std::size_t stride = feature_.size();
    gather(features, neighbours, positions, row);
    turn(p_.op.fiber_in, feature_, true);
    messages();
    turn(p_.messages, message_, false);
    const T* own = features + row * stride;
    attend(own);
    project(own, out);
  }

 private:
  using Buffer = std::vector<Edges, Eigen::aligned_allocator<Edges>>;

  void gather(const T* features, const std::uint32_t* neighbours, const T* positions, std::size_t row) {
    const T* centre = positions + 6 * row;
    Edges d[2][3];
    for (auto& side : d)
      for (Edges& component : side) component.setZero();
    if (k_ < Width) {
      for (Edges& f : feature_) f.setZero();
      for (Edges& c : coefficient_) c.setZero();
    }
    for (int j = 0; j < k_; ++j) {
      const T* at = positions + 6 * std::size_t{neighbours[j]};
      for (int s = 0; s < 2; ++s)
        for (int a = 0; a < 3; ++a) d[s][a][j] = centre[3 * s + (a + 1) % 3] - at[3 * s + (a + 1) % 3];
      const T* f = features + neighbours[j] * feature_.size();
      for (std::size_t c = 0; c < feature_.size(); ++c) feature_[c][j] = f[c];
    }
    Edges length[2];
    for (int s = 0; s < 2; ++s) {
      length[s] = (d[s][0].square() + d[s][1].square() + d[s][2].square()).sqrt();
      frame(d[s], length[s], frame_[s]);
    }
    for (int j = 0; j < k_; ++j) {
      edge_.assign(edge_.size(), T{0});
      for (const Sectors<T>& table : p_.tables) table.add(length[0][j], length[1][j], edge_.data());
      for (int s = 0; s < 2; ++s)
        if (length[s][j] == 0)
          for (const auto& block : p_.op.blocks) keep_scalar_part(block, s == 0, edge_.data());
      for (std::size_t c = 0; c < edge_.size(); ++c) coefficient_[c][j] = edge_[c];
    }
  }

  // A right-handed orthonormal frame (rows) whose first axis is the direction. The angle about it cancels; so does
  // the whole frame where the length is zero.
  static void frame(const Edges* d, const Edges& length, Edges (&rows)[3][3]) {
    const auto positive = length > 0;
    const Edges scale = positive.select(length.inverse(), Edges::Zero());
    const Edges x = d[0] * scale, y = d[1] * scale, z = positive.select(d[2] * scale, Edges::Ones());
    const Edges sign = (z >= 0).select(Edges::Ones(), -Edges::Ones());
    const Edges a = -(sign + z).inverse(), b = x * y * a;
    rows[0][0] = x, rows[0][1] = y, rows[0][2] = z;
    rows[1][0] = 1 + sign * x * x * a, rows[1][1] = sign * b, rows[1][2] = -sign * x;
    rows[2][0] = b, rows[2][1] = sign + y * y * a, rows[2][2] = -y;
  }

  // Into the edges' frames, or back.
  void turn(const irreps::Fiber& fiber, Buffer& rows, bool into) {
    int at = 0;
    for (const auto& [d, m] : fiber)
      for (int c = 0; c < m; ++c, at += d.dim()) {
        const int inner = 2 * d.q + 1;
        if (d.p == 1)
          for (int j = 0; j < inner; ++j) turn_vector(frame_[0], &rows[at + j], inner, into);
        if (d.q == 1)
          for (int i = 0; i < 2 * d.p + 1; ++i) turn_vector(frame_[1], &rows[at + 3 * i], 1, into);
      }
  }
  static void turn_vector(const Edges (&f)[3][3], Edges* v, int step, bool into) {
    const Edges x = v[0], y = v[step], z = v[2 * step];
    for (int i = 0; i < 3; ++i)
      v[i * step] = into ? Edges(f[i][0] * x + f[i][1] * y + f[i][2] * z) : Edges(f[0][i] * x + f[1][i] * y + f[2][i] * z);
  }

  void messages() {
    for (Edges& m : message_) m.setZero();
    for (std::size_t b = 0; b < p_.op.blocks.size(); ++b) {
      const ops::PairBlock& block = p_.op.blocks[b];
      const Edges* in = &feature_[p_.op.fiber_in.offset(block.in)];
      Edges* out = &message_[p_.messages.offset(block.out)];
      const int dim_in = block.in.dim(), dim_out = block.out.dim();
      for (int o = 0; o < block.out_channels; ++o)
        for (const Term& term : p_.terms[b]) {
          const Edges* weight =
              &coefficient_[block.coefficients + (term.coefficient * block.out_channels + o) * block.in_channels];
          Edges sum = weight[0] * in[term.in];
          for (int i = 1; i < block.in_channels; ++i) sum += weight[i] * in[i * dim_in + term.in];
          Edges& target = out[(block.out_begin + o) * dim_out + term.out];
          if (term.negative)
            target -= sum;
          else
            target += sum;
        }
    }
  }

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
    if (op.relu) p_.relu.apply(out);
  }

  const Prepared<T>& p_;
  const int k_;
  Edges frame_[2][3][3];
  Buffer coefficient_;
  std::vector<T> edge_;
  Buffer feature_, message_, weight_;
  std::vector<T> query_, sum_;
};

template <class T>
class PairAttentionKernel : public Kernel<T> {
 public:
  explicit PairAttentionKernel(const ops::PairAttention& op) : prepared_(op) {}

  void run(const Arguments& args) const override {
    const int k = args.in[1].per_row;
    if (k <= 8) return run_width<8>(args);
    if (k <= 16) return run_width<16>(args);
    if (k <= 24) return run_width<24>(args);
    if (k <= 32) return run_width<32>(args);
    run_width<64>(args);
  }

 private:
  template <int Width>
  void run_width(const Arguments& args) const {
    const Slot &features = args.in[0], &edges = args.in[1], &out = args.out[0];
    const std::size_t k = edges.per_row;
    args.pool.parallel_for(args.rows(out), 4, [&](std::size_t begin, std::size_t end) {
      PairRow<T, Width> node(prepared_, edges.per_row);
      for (std::size_t row = begin; row < end; ++row)
        node.evaluate(features.as<T>(), edges.as<std::uint32_t>() + row * k, args.in[2].as<T>(), row,
                      out.as<T>() + row * out.stride());
    });
  }

  const Prepared<T> prepared_;
};

}  // namespace

template <class T>
KernelPtr<T> make_kernel(const ops::PairAttention& op) {
  return std::make_unique<PairAttentionKernel<T>>(op);
}
template KernelPtr<float> make_kernel(const ops::PairAttention&);
template KernelPtr<double> make_kernel(const ops::PairAttention&);

}  // namespace bitr::cpu
