// The backward pass of point_attention on a block of points, one per lane. Paths, logits and sums over edges
// are made again.
#pragma once

#include "cpu/pack_relu.hpp"
#include "cpu/point_attention_gradient.hpp"
#include "cpu/point_matrices.hpp"
#include "cpu/point_path_set.hpp"

namespace bitr::cpu {

/// `given`: the gradient of the layer's output.
template <class T>
class PointBlock {
  using P = Pack<T>;
  static constexpr int lanes = pack_lanes<T>;

 public:
  PointBlock(const ops::PointAttention& op, const PointMatrices& matrices, const PointInputs<T>& in,
             const T* grad_output, int k)
      : op_(op),
        in_(in),
        grad_output_(grad_output),
        k_(k),
        edge_(op, false, k),
        zero_(op, true, k),
        neighbor_(static_cast<std::size_t>(k * lanes)),
        direction_(static_cast<std::size_t>(3 * k)),
        d_direction_(direction_.size()),
        scale_(static_cast<std::size_t>(k)),
        weight_(static_cast<std::size_t>(op.heads * k)),
        d_weight_(weight_.size()),
        own_(static_cast<std::size_t>(op.c0 + 1 + 3 * op.c1)),
        d_own_(own_.size()),
        out_(static_cast<std::size_t>(op.m0 + 3 * op.m1)),
        d_out_(out_.size()),
        edge_query_(static_cast<std::size_t>(edge_.count())),
        edge_sum_(edge_query_.size()),
        zero_query_(static_cast<std::size_t>(zero_.count())),
        zero_sum_(zero_query_.size()),
        scratch_(std::max({edge_query_.size(), zero_query_.size(), out_.size(), own_.size()})) {
    for (int i = 0; i < point_matrices; ++i) matrix_[i] = PackMatrix<T>(matrices[i]);
  }

  /// Rows [begin, end), at most `lanes`; adds to `out`.
  void differentiate(std::size_t begin, std::size_t end, const PointGradients<T>& out) {
    begin_ = begin;
    count_ = static_cast<int>(end - begin);
    load();
    forward();
    if (op_.relu) {
      differentiate_leaky<T>(op_.m0, out_.data(), d_out_.data());
      differentiate_relu(matrix_[plane], op_.m1, op_.relu_square, out1(out_, 0), out1(d_out_, 0),
                         scratch_.data());
    }
    std::fill(d_own_.begin(), d_own_.end(), zero_pack<T>());
    backward(out);
    store(out);
  }

  void flush(PointMatrices& sums) {
    for (int i = 0; i < point_matrices; ++i) matrix_[i].flush(sums[i]);
  }

 private:
  std::size_t row(int lane) const { return begin_ + static_cast<std::size_t>(std::min(lane, count_ - 1)); }
  std::size_t neighbor(int lane, int j) const { return neighbor_[j * lanes + lane]; }

  // Rows past the end repeat the last one with a gradient of zero.
  void load() {
    const int width = op_.c0 + 3 * op_.c1;
    for (int lane = 0; lane < lanes; ++lane) {
      const std::uint32_t* index = in_.index + row(lane) * k_;
      for (int j = 0; j < k_; ++j) neighbor_[j * lanes + lane] = index[j];
    }
    const T* rows[lanes];
    for (int j = 0; j < k_; ++j) {
      for (int lane = 0; lane < lanes; ++lane)
        rows[lane] = in_.features + neighbor(lane, j) * in_.feature_stride;
      gather(rows, width, edge_.features(j));
    }
    for (int j = 0; j < k_; ++j) {
      for (int lane = 0; lane < lanes; ++lane) {
        const T* at = in_.neighbors + 3 * neighbor(lane, j);
        for (int a = 0; a < 3; ++a) direction_[3 * j + a][lane] = at[(a + 1) % 3];
      }
    }
    P centre[3];
    for (int lane = 0; lane < lanes; ++lane)
      for (int a = 0; a < 3; ++a) centre[a][lane] = in_.centres[3 * row(lane) + (a + 1) % 3];
    duplicates_ = false;
    for (int j = 0; j < k_; ++j) set_direction(centre, j);
    load_own();
  }

  void load_own() {
    const T* rows[lanes];
    if (!op_.uniform) {
      for (int lane = 0; lane < lanes; ++lane) rows[lane] = in_.features + row(lane) * in_.feature_stride;
      gather(rows, op_.c0 + 3 * op_.c1, scratch_.data());
      by_axis(scratch_.data(), op_.c0, op_.c1, own0(), own1(own_, 0));
      own0()[op_.c0] = zero_pack<T>() + 1;
    }
    const int width = op_.m0 + 3 * op_.m1;
    for (int lane = 0; lane < lanes; ++lane) rows[lane] = grad_output_ + row(lane) * width;
    gather(rows, width, scratch_.data());
    P there;
    for (int lane = 0; lane < lanes; ++lane) there[lane] = lane < count_ ? T{1} : T{0};
    for (int c = 0; c < width; ++c) scratch_[c] *= there;
    by_axis(scratch_.data(), op_.m0, op_.m1, d_out_.data(), out1(d_out_, 0));
  }

  // Vectors from channel by channel to axis by axis.
  static void by_axis(const P* from, int scalars, int vectors, P* to0, P* to1) {
    std::copy_n(from, scalars, to0);
    for (int c = 0; c < vectors; ++c)
      for (int a = 0; a < 3; ++a) to1[a * vectors + c] = from[scalars + 3 * c + a];
  }

  // The feature of an edge of length zero moves to the other set of paths.
  void set_direction(const P* centre, int j) {
    const P none = zero_pack<T>();
    P* d = &direction_[3 * j];
    for (int a = 0; a < 3; ++a) d[a] = centre[a] - d[a];
    const P square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    P length = square;
    as_array<T>(length) = as_array<T>(length).sqrt().max(static_cast<T>(ops::direction_eps));
    scale_[j] = square > none ? 1 / length : none;
    for (int a = 0; a < 3; ++a) d[a] *= scale_[j];
    P is_zero = square > none ? none : none + 1;
    if (!duplicates_) {
      if (!(as_array<T>(is_zero) > 0).any()) return;
      duplicates_ = true;
      for (int i = 0; i < j; ++i) std::fill_n(zero_.features(i), zero_.inputs(), none);
    }
    for (int c = 0; c < edge_.inputs(); ++c) {
      zero_.features(j)[c] = edge_.features(j)[c] * is_zero;
      edge_.features(j)[c] -= zero_.features(j)[c];
    }
    zero_.features(j)[edge_.inputs()] = is_zero;
  }

  // Parts of own features [f⁰ 1, f¹ by axis] and of outputs [degree 0, degree 1 by axis].
  P* own0() { return own_.data(); }
  P* own1(Packs<T>& own, int axis) { return own.data() + op_.c0 + 1 + axis * op_.c1; }
  P* out1(Packs<T>& out, int axis) { return out.data() + op_.m0 + axis * op_.m1; }

  void forward() {
    std::fill(out_.begin(), out_.end(), zero_pack<T>());
    if (op_.uniform) {
      std::fill(weight_.begin(), weight_.end(), zero_pack<T>() + T{1} / static_cast<T>(k_));
      std::fill(edge_query_.begin(), edge_query_.end(), zero_pack<T>());
      std::fill(zero_query_.begin(), zero_query_.end(), zero_pack<T>());
    } else {
      std::fill(weight_.begin(), weight_.end(), zero_pack<T>());
      score(edge_, M0, M1, edge_query_);
      if (duplicates_) score(zero_, Mz0, Mz1, zero_query_);
      softmax();
      matrix_[S0].add_product(own0(), out_.data());
      for (int a = 0; a < 3; ++a) matrix_[S1].add_product(own1(own_, a), out1(out_, a));
    }
    aggregate(edge_, O0, O1, edge_sum_);
    if (duplicates_) aggregate(zero_, Oz0, Oz1, zero_sum_);
  }

  void score(const PointPathSet<T>& set, PointMatrix degree0, PointMatrix degree1, Packs<T>& query) {
    std::fill(query.begin(), query.end(), zero_pack<T>());
    matrix_[degree0].add_product(own0(), query.data());
    for (int a = 0; a < set.axes(); ++a)
      matrix_[degree1].add_product(own1(own_, a), query.data() + set.degree1(a));
    set.add_products(query.data(), direction_.data(), weight_.data());
  }

  void softmax() {
    for (int h = 0; h < op_.heads; ++h) {
      P largest = weight_[h], total = zero_pack<T>();
      for (int j = 1; j < k_; ++j) {
        const P logit = weight_[j * op_.heads + h];
        largest = logit > largest ? logit : largest;
      }
      for (int j = 0; j < k_; ++j) {
        P& e = weight_[j * op_.heads + h];
        e -= largest;
        as_array<T>(e) = as_array<T>(e).exp();
        total += e;
      }
      const P scale = 1 / total;
      for (int j = 0; j < k_; ++j) weight_[j * op_.heads + h] *= scale;
    }
  }

  void aggregate(const PointPathSet<T>& set, PointMatrix degree0, PointMatrix degree1, Packs<T>& sum) {
    set.sum(weight_.data(), direction_.data(), sum.data());
    matrix_[degree0].add_product(sum.data(), out_.data());
    for (int a = 0; a < set.axes(); ++a)
      matrix_[degree1].add_product(sum.data() + set.degree1(a), out1(out_, a));
  }

  void backward(const PointGradients<T>& out) {
    const bool turn = out.centres || out.neighbors;
    if (!op_.uniform) {
      matrix_[S0].differentiate(d_out_.data(), own0(), d_own_.data());
      matrix_[S1].differentiate(out1(d_out_, 0), own1(own_, 0), own1(d_own_, 0), 3, op_.m1, op_.c1);
    }
    std::fill(d_weight_.begin(), d_weight_.end(), zero_pack<T>());
    differentiate_sum(edge_, O0, O1, edge_sum_);
    if (duplicates_) differentiate_sum(zero_, Oz0, Oz1, zero_sum_);
    if (op_.uniform)
      std::fill(d_weight_.begin(), d_weight_.end(), zero_pack<T>());
    else
      differentiate_softmax();

    if (turn) std::fill(d_direction_.begin(), d_direction_.end(), zero_pack<T>());
    differentiate_paths(edge_, M0, M1, edge_query_, edge_sum_, turn ? d_direction_.data() : nullptr, out);
    if (!duplicates_) return;
    differentiate_paths(zero_, Mz0, Mz1, zero_query_, zero_sum_, nullptr, out);
    for (int j = 0; j < k_; ++j) {
      const P is_zero = zero_.features(j)[edge_.inputs()];
      for (int c = 0; c < edge_.inputs(); ++c) {
        P& gradient = edge_.gradient(j)[c];
        gradient = is_zero > 0 ? zero_.gradient(j)[c] : gradient;
      }
    }
  }

  // `sum` becomes its own gradient.
  void differentiate_sum(const PointPathSet<T>& set, PointMatrix degree0, PointMatrix degree1,
                         Packs<T>& sum) {
    std::fill(scratch_.begin(), scratch_.end(), zero_pack<T>());
    matrix_[degree0].differentiate(d_out_.data(), sum.data(), scratch_.data());
    matrix_[degree1].differentiate(out1(d_out_, 0), sum.data() + set.degree1(0),
                                   scratch_.data() + set.degree1(0), set.axes(), op_.m1, set.axis_step());
    std::copy_n(scratch_.begin(), sum.size(), sum.begin());
    set.add_products(sum.data(), direction_.data(), d_weight_.data());
  }

  // From the gradient of the weights to that of the logits.
  void differentiate_softmax() {
    for (int h = 0; h < op_.heads; ++h) {
      P mean = zero_pack<T>();
      for (int i = h; i < op_.heads * k_; i += op_.heads) mean += weight_[i] * d_weight_[i];
      for (int i = h; i < op_.heads * k_; i += op_.heads) d_weight_[i] = weight_[i] * (d_weight_[i] - mean);
    }
  }

  void differentiate_paths(PointPathSet<T>& set, PointMatrix degree0, PointMatrix degree1,
                           const Packs<T>& query, const Packs<T>& d_sum, P* d_directions,
                           const PointGradients<T>& out) {
    if (!op_.uniform) {
      set.sum(d_weight_.data(), direction_.data(), scratch_.data());
      matrix_[degree0].differentiate(scratch_.data(), own0(), d_own_.data());
      matrix_[degree1].differentiate(scratch_.data() + set.degree1(0), own1(own_, 0), own1(d_own_, 0),
                                     set.axes(), set.axis_step(), op_.c1);
    }
    if (out.features || d_directions)
      set.differentiate(weight_.data(), d_sum.data(), d_weight_.data(), query.data(), direction_.data(),
                        d_directions);
  }

  void store(const PointGradients<T>& out) {
    if (out.features) {
      const int c0 = op_.c0, width = c0 + 3 * op_.c1;
      T* rows[lanes];
      if (!op_.uniform) {
        std::copy_n(d_own_.data(), c0, scratch_.data());
        for (int c = 0; c < op_.c1; ++c)
          for (int a = 0; a < 3; ++a) scratch_[c0 + 3 * c + a] = own1(d_own_, a)[c];
        for (int lane = 0; lane < count_; ++lane) rows[lane] = out.features + row(lane) * width;
        scatter(scratch_.data(), width, count_, rows);
      }
      for (int j = 0; j < k_; ++j) {
        for (int lane = 0; lane < count_; ++lane) rows[lane] = out.features + neighbor(lane, j) * width;
        scatter(edge_.gradient(j), width, count_, rows);
      }
    }
    if (out.centres || out.neighbors) store_positions(out);
  }

  // v = d / |d|
  void store_positions(const PointGradients<T>& out) {
    for (int j = 0; j < k_; ++j) {
      const P *v = &direction_[3 * j], *g = &d_direction_[3 * j];
      const P along = v[0] * g[0] + v[1] * g[1] + v[2] * g[2];
      for (int a = 0; a < 3; ++a) {
        const P d = scale_[j] * (g[a] - along * v[a]);
        for (int lane = 0; lane < count_; ++lane) {
          if (out.centres) out.centres[3 * row(lane) + (a + 1) % 3] += d[lane];
          if (out.neighbors) out.neighbors[3 * neighbor(lane, j) + (a + 1) % 3] -= d[lane];
        }
      }
    }
  }

  const ops::PointAttention& op_;
  const PointInputs<T>& in_;
  const T* grad_output_;
  const int k_;
  std::size_t begin_ = 0;
  int count_ = 0;
  bool duplicates_ = false;
  PointPathSet<T> edge_, zero_;
  std::vector<std::uint32_t> neighbor_;
  std::array<PackMatrix<T>, point_matrices> matrix_;
  // Over edges: v, 1/|d| (0 where d is), softmax weights and the gradient of the weights, then of the logits.
  Packs<T> direction_, d_direction_, scale_, weight_, d_weight_;
  Packs<T> own_, d_own_, out_, d_out_;
  // Per path: queries; sums over the edges, then their gradients.
  Packs<T> edge_query_, edge_sum_, zero_query_, zero_sum_, scratch_;
};

}  // namespace bitr::cpu
