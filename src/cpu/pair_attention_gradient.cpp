// The gradient of a two-sided layer, edge by edge in the edges' own frames. The angle about an edge's
// direction cancels in the forward pass, so that a direction's gradient is a torque: turning the direction of
// an edge by ω changes its messages by [ω]·message − kernel([ω]·feature), whatever the frame.
#include <array>

#include "cpu/pair_attention.hpp"
#include "cpu/projected_relu_gradient.hpp"
#include "cpu/sums_at_once.hpp"
#include "ops/constants.hpp"

namespace bitr::cpu {
namespace {

using irreps::Degree;
using irreps::Fiber;

// Where the gradients of a layer's constants lie in one row of numbers (the order of ops/constants.hpp).
struct ConstantPlaces {
  explicit ConstantPlaces(const ops::PairAttention& op) {
    for (const ops::SectorTable& table : op.tables) {
      tables.push_back(count);
      const std::size_t size = static_cast<std::size_t>(table.size);
      count += table.scale_degree == 1 ? table.sectors() * 2 * size : table.sectors() * (4 * size + 6) + 3;
    }
    const auto place = [&](const ops::DegreeMatrices& matrices, std::map<Degree, std::size_t>& to) {
      for (const auto& [d, matrix] : matrices) {
        to[d] = count;
        count += static_cast<std::size_t>(matrix.size());
      }
    };
    place(op.query, query);
    place(op.project, project);
    place(op.self, self);
    place(op.planes, planes);
  }
  std::vector<std::size_t> tables;
  std::map<Degree, std::size_t> query, project, self, planes;
  std::size_t count = 0;
};

// Adds Σ a × b over the vectors of one side of a fiber's rows.
template <class Edges>
void add_torque(const Fiber& fiber, int side, const Edges* a, const Edges* b, Edges* torque) {
  for (const auto& [d, m] : fiber) {
    const int dim = d.dim(), inner = 2 * d.q + 1;
    if ((side == 0 ? d.p : d.q) == 1) {
      const int others = side == 0 ? inner : 2 * d.p + 1, first = side == 0 ? 1 : 3,
                step = side == 0 ? inner : 1;
      for (int c = 0; c < m; ++c)
        for (int o = 0; o < others; ++o) {
          const Edges *u = a + c * dim + o * first, *v = b + c * dim + o * first;
          for (int i = 0; i < 3; ++i) {
            const int j = (i + 1) % 3 * step, k = (i + 2) % 3 * step;
            torque[i] += u[j] * v[k] - u[k] * v[j];
          }
        }
    }
    a += m * dim;
    b += m * dim;
  }
}

template <class T>
struct RowGradients {
  T* features = nullptr;   // all rows'; nullptr: not wanted
  T* positions = nullptr;  // all rows'; nullptr: not wanted
  T* constants;            // ConstantPlaces::count
};

template <class T, int Width>
class PairGradientRow : private PairRow<T, Width> {
  using Base = PairRow<T, Width>;
  using typename Base::Buffer;
  using typename Base::Edges;
  using typename Base::Numbers;

 public:
  PairGradientRow(const PairConstants<T>& constants, const ConstantPlaces& places, int k)
      : Base(constants, k),
        places_(places),
        d_message_(this->message_.size()),
        d_feature_(this->feature_.size()),
        d_coefficient_(this->coefficient_.size()),
        d_logit_(constants.op.heads),
        d_out_(this->result_.size()),
        d_sum_(this->sum_.size()),
        d_query_(this->query_.size()),
        d_own_(this->feature_.size()) {}

  /// d_out: of this row's result.
  void evaluate(const T* features, const std::uint32_t* neighbors, const T* positions, std::size_t row,
                const T* d_out, const RowGradients<T>& to) {
    const std::size_t stride = this->feature_.size();
    const T* own = features + row * stride;
    Base::gather(features, neighbors, positions, row);
    Base::messages();
    Base::attend(own);
    std::copy_n(d_out, d_out_.size(), d_out_.begin());
    std::fill(d_own_.begin(), d_own_.end(), T{0});
    if (p_.op.relu) {
      Base::project(own, this->result_.data());
      relu(to.constants);
    }
    project(own, to.constants);
    attend(own, to.constants);
    if (to.positions) torques_of_messages();
    turn(p_.messages, this->frame_, d_message_.data(), true);
    kernels();
    coefficients(to);
    if (to.positions) move_points(neighbors, row, to.positions);
    if (!to.features) return;
    turn(p_.op.fiber_in, this->frame_, d_feature_.data(), false);
    for (int j = 0; j < this->k_; ++j) {
      T* neighbor = to.features + neighbors[j] * stride;
      for (std::size_t c = 0; c < stride; ++c) neighbor[c] += d_feature_[c][j];
    }
    for (std::size_t c = 0; c < stride; ++c) to.features[row * stride + c] += d_own_[c];
  }

 private:
  using Matrix = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic>;
  using Row = Eigen::Map<RowMatrix<T>>;
  using ConstRow = Eigen::Map<const RowMatrix<T>>;

  void relu(T* constants) {
    const Fiber& fiber = p_.op.fiber_out;
    const int scalars = fiber.channels({0, 0});
    for (int c = 0; c < scalars; ++c)
      if (!(this->result_[c] > 0)) d_out_[c] *= static_cast<T>(ops::leaky_slope);
    for (const auto& part : p_.relu.parts())
      projected_relu_gradient(part.plane, p_.op.relu_square, part.dim, &this->result_[part.offset],
                              &d_out_[part.offset], constants + places_.planes.at(part.degree));
  }

  // out = project · sums + self · own
  void project(const T* own, T* constants) {
    const auto& op = p_.op;
    for (const auto& [d, m] : op.fiber_out) {
      const int dim = d.dim();
      const ConstRow d_out(&d_out_[op.fiber_out.offset(d)], m, dim);
      const RowMatrix<T>& matrix = p_.project.at(d);
      const ConstRow sum(&this->sum_[op.value_fiber.offset(d)], matrix.cols(), dim);
      Eigen::Map<Matrix>(constants + places_.project.at(d), m, matrix.cols()) +=
          d_out.lazyProduct(sum.transpose());
      Row(&d_sum_[op.value_fiber.offset(d)], matrix.cols(), dim) = matrix.transpose().lazyProduct(d_out);
      if (const auto self = p_.self.find(d); self != p_.self.end()) {
        const ConstRow x(own + op.fiber_in.offset(d), self->second.cols(), dim);
        Eigen::Map<Matrix>(constants + places_.self.at(d), m, x.rows()) += d_out.lazyProduct(x.transpose());
        Row(&d_own_[op.fiber_in.offset(d)], x.rows(), dim) += self->second.transpose().lazyProduct(d_out);
      }
    }
  }

  // Softmax attention; leaves the gradient of the messages.
  void attend(const T* own, T* constants) {
    const auto& op = p_.op;
    for (Edges& d : d_logit_) d.setZero();
    for (const auto& [d, values] : op.value_fiber) {
      const int dim = d.dim(), per_head = values / op.heads;
      const std::size_t at = p_.messages.offset(d);
      const T* d_sum = &d_sum_[op.value_fiber.offset(d)];
      for (int c = 0; c < values; ++c)
        for (int m = c * dim; m < (c + 1) * dim; ++m) {
          d_logit_[c / per_head] += d_sum[m] * this->message_[at + m];
          d_message_[at + m] = d_sum[m] * this->weight_[c / per_head];
        }
    }
    for (int h = 0; h < op.heads; ++h) {
      const Edges& weight = this->weight_[h];
      d_logit_[h] = weight * (d_logit_[h] - (weight * d_logit_[h]).sum());
    }
    for (const auto& [d, keys] : op.key_fiber) {
      const RowMatrix<T>& matrix = p_.query.at(d);
      const int dim = d.dim(), per_head = keys / op.heads;
      const std::size_t at = p_.messages.offset(d) + op.value_fiber.channels(d) * dim;
      const ConstRow x(own + op.fiber_in.offset(d), matrix.cols(), dim);
      Row query(this->query_.data(), keys, dim), d_query(d_query_.data(), keys, dim);
      query = matrix.lazyProduct(x);
      for (int c = 0; c < keys; ++c)
        for (int m = 0; m < dim; ++m) {
          d_query(c, m) = (d_logit_[c / per_head] * this->message_[at + c * dim + m]).sum();
          d_message_[at + c * dim + m] = d_logit_[c / per_head] * query(c, m);
        }
      Eigen::Map<Matrix>(constants + places_.query.at(d), keys, matrix.cols()) +=
          d_query.lazyProduct(x.transpose());
      Row(&d_own_[op.fiber_in.offset(d)], matrix.cols(), dim) += matrix.transpose().lazyProduct(d_query);
    }
  }

  void torques_of_messages() {
    for (int s = 0; s < 2; ++s) {
      for (Edges& t : torque_[s]) t.setZero();
      add_torque(p_.messages, s, this->message_.data(), d_message_.data(), torque_[s]);
    }
  }

  // In the frames: the gradients of coefficients and features.
  void kernels() {
    for (Edges& d : d_feature_) d.setZero();
    for (Edges& d : d_coefficient_) d.setZero();
    for (std::size_t b = 0; b < p_.op.blocks.size(); ++b) {
      const ops::PairBlock& block = p_.op.blocks[b];
      const int dim_in = block.in.dim(), dim_out = block.out.dim(), channels = block.in_channels;
      const Edges* in = &this->feature_[p_.op.fiber_in.offset(block.in)];
      Edges* d_in = &d_feature_[p_.op.fiber_in.offset(block.in)];
      const Edges* d_out = &d_message_[p_.messages.offset(block.out) + block.out_begin * dim_out];
      for (int o = 0; o < block.out_channels; ++o)
        for (const Term& term : p_.terms[b]) {
          const int at = block.coefficients + (term.coefficient * block.out_channels + o) * channels;
          const Edges d =
              term.negative ? Edges(-d_out[o * dim_out + term.out]) : d_out[o * dim_out + term.out];
          for (int i = 0; i < channels; ++i) {
            d_coefficient_[at + i] += d * in[i * dim_in + term.in];
            d_in[i * dim_in + term.in] += d * this->coefficient_[at + i];
          }
        }
    }
  }

  void coefficients(const RowGradients<T>& to) {
    const std::size_t count = d_coefficient_.size();
    for (std::size_t c = 0; c < count; ++c)
      for (int j = 0; j < this->k_; ++j) this->edge(j)[c] = d_coefficient_[c][j];
    const Edges* length = this->length_;
    for (int j = 0; j < this->k_; ++j)
      for (int s = 0; s < 2; ++s)
        if (const T norm = length[s][j] / static_cast<T>(ops::direction_eps); norm < 1)
          for (const auto& block : p_.op.blocks)
            shorten_direction_gradient(block, s == 0, norm, this->edge(j));
    for (Edges& d : d_length_) d.setZero();
    for (std::size_t t = 0; t < p_.tables.size(); ++t)
      for (int j = 0; j < this->k_; ++j)
        p_.tables[t].add_gradient(length[0][j], length[1][j], this->edge(j), to.constants + places_.tables[t],
                                  d_length_[0][j], d_length_[1][j]);
  }

  // An edge's vector turns its frame and changes its lengths.
  void move_points(const std::uint32_t* neighbors, std::size_t row, T* d_positions) {
    for (int s = 0; s < 2; ++s) {
      Edges turned[3];
      for (Edges& t : turned) t.setZero();
      add_torque(p_.op.fiber_in, s, this->feature_.data(), d_feature_.data(), turned);
      Edges* torque = torque_[s];
      this->frame_[s].turn(torque, 1, true);
      for (int i = 0; i < 3; ++i) torque[i] -= turned[i];
      const Edges inverse = (this->length_[s] > 0).select(this->length_[s].inverse(), Edges::Zero());
      Edges d[3] = {(this->length_[s] > 0).select(d_length_[s], Edges::Zero()), torque[2] * inverse,
                    -torque[1] * inverse};
      this->frame_[s].turn(d, 1, false);
      for (int j = 0; j < this->k_; ++j)
        for (int a = 0; a < 3; ++a) {
          const std::size_t component = 3 * s + (a + 1) % 3;
          d_positions[6 * row + component] += d[a][j];
          d_positions[6 * std::size_t{neighbors[j]} + component] -= d[a][j];
        }
    }
  }

  const PairConstants<T>& p_ = Base::p_;
  const ConstantPlaces& places_;
  Buffer d_message_, d_feature_, d_coefficient_, d_logit_;
  Numbers d_out_, d_sum_, d_query_, d_own_;
  Edges torque_[2][3], d_length_[2];
};

template <class T>
class PairAttentionGradientKernel : public Kernel<T> {
 public:
  explicit PairAttentionGradientKernel(const ops::Gradient<ops::PairAttention>& op)
      : op_(op), constants_(op.op), places_(op.op) {}

  void run(const Arguments& args) const override {
    with_width<24, 64>(args.in[1].per_row, [&](auto width) { run_width<width()>(args); });
  }

 private:
  template <int Width>
  void run_width(const Arguments& args) const {
    const GradientSlots<ops::PairAttention> slots{op_, args};
    const Slot &features = slots.in(0), &edges = slots.in(1);
    const auto clear = [&](const Slot* slot) -> T* {
      if (!slot) return nullptr;
      std::fill_n(slot->template as<T>(), args.rows(*slot) * slot->stride(), T{0});
      return slot->template as<T>();
    };
    T *d_features = clear(slots.grad_input(0)), *d_positions = clear(slots.grad_input(2));
    const T* d_out = slots.grad_output(0)->template as<T>();
    const std::size_t k = edges.per_row, out_stride = slots.out(0).stride();
    const auto differentiate_pair = [&](std::size_t pair, std::vector<T>& constants) {
      constants.assign(places_.count, T{0});
      const RowGradients<T> to{d_features, d_positions, constants.data()};
      PairGradientRow<T, Width> node(constants_, places_, edges.per_row);
      const auto begin = [&](std::size_t i) {
        return args.layout.begin(graph::Rows::pair_key, static_cast<std::uint32_t>(i));
      };
      for (std::size_t row = begin(pair); row < begin(pair + 1); ++row)
        node.evaluate(features.as<T>(), edges.as<std::uint32_t>() + row * k, slots.in(2).template as<T>(),
                      row, d_out + row * out_stride, to);
    };

    // Every pair has a sum of its own, and these are added in the pairs' order: how many are made side by side
    // changes no bit.
    const std::size_t pairs = args.layout.pairs();
    std::vector<std::vector<T>> sums(sums_at_once(pairs, args.pool.threads(), places_.count * sizeof(T)));
    std::vector<double> totals(slots.constants() ? places_.count : 0);
    for (std::size_t first = 0; first < pairs; first += sums.size()) {
      const std::size_t count = std::min(sums.size(), pairs - first);
      args.pool.parallel_for(count, 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) differentiate_pair(first + i, sums[i]);
      });
      args.pool.parallel_for(totals.size(), 4096, [&](std::size_t begin, std::size_t end) {
        for (std::size_t s = 0; s < count; ++s)
          for (std::size_t i = begin; i < end; ++i) totals[i] += static_cast<double>(sums[s][i]);
      });
    }
    if (const Slot* to = slots.constants())
      std::transform(totals.begin(), totals.end(), to->template as<T>(),
                     [](double x) { return static_cast<T>(x); });
  }

  const ops::Gradient<ops::PairAttention> op_;
  const PairConstants<T> constants_;
  const ConstantPlaces places_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::Gradient<ops::PairAttention>& op) {
  return std::make_unique<PairAttentionGradientKernel<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::Gradient<ops::PairAttention>& op) {
  return std::make_unique<PairAttentionGradientKernel<double>>(op);
}

}  // namespace bitr::cpu
