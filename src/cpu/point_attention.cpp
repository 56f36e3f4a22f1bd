#include "cpu/point_attention.hpp"

#include <algorithm>
#include <cmath>

#include "cpu/projected_relu.hpp"

namespace bitr::cpu {
namespace {

// One point's edges, one lane each (Width ≥ k lanes; the rest carry no weight).
template <class T, int Width>
class PointRow {
 public:
  using Edges = Lanes<T, Width>;

  PointRow(const ops::PointAttention& op, const RowMatrix<T>& plane, int k)
      : op_(op),
        plane_(plane),
        k_(k),
        n0_(op.n0()),
        n1_(op.m1 > 0 ? op.n1() : 0),
        z0_(op.c0 + 1),
        z1_(op.m1 > 0 ? op.c1 : 0),
        feature_(op.c0 + 3 * op.c1),
        phi0_(n0_),
        phi1_(3 * n1_),
        zero_feature_(op.c0 + 3 * op.c1),
        weight_(op.heads),
        query_(op.heads * std::max(n0_ + 3 * n1_, z0_ + 3 * z1_)),
        sum_(query_.size()),
        component_(op.c1) {}

  void evaluate(const PointCoefficients<T>& coefficients, const PointInputs<T>& in, std::size_t row) {
    const bool duplicates = gather(in, row);
    products();
    const T* own = in.features + row * in.feature_stride;
    T* out = in.out + row * (op_.m0 + 3 * op_.m1);
    std::fill_n(out, op_.m0 + 3 * op_.m1, T{0});
    if (op_.uniform) {
      weight_[0].setConstant(T{1} / static_cast<T>(k_));
      weight_[0].tail(Width - k_).setZero();
    } else {
      for (Edges& e : weight_) e.setZero();
      score(coefficients.M0, coefficients.M1, own, phi0_, n0_, phi1_, n1_);
      if (duplicates) score_zero(coefficients, own);
      softmax();
      self(coefficients, own, out);
    }
    aggregate(coefficients.O0, coefficients.O1, phi0_, n0_, phi1_, n1_, out);
    if (duplicates) aggregate_zero(coefficients, out);
    if (op_.relu) {
      for (int c = 0; c < op_.m0; ++c) out[c] = leaky(out[c]);
      projected_relu(plane_, op_.relu_square, 3, out + op_.m0);
    }
  }

 private:
  using Buffer = std::vector<Edges, Eigen::aligned_allocator<Edges>>;

  // Directions and features of the neighbours, a lane per edge. True if some edge has length zero; its
  // feature then moves to zero_feature_.
  bool gather(const PointInputs<T>& in, std::size_t row) {
    const std::uint32_t* neighbor = in.index + row * k_;
    const T* centre = in.centres + 3 * row;
    Edges d[3];
    for (Edges& component : d) component.setZero();
    if (k_ < Width)
      for (Edges& f : feature_) f.setZero();
    const int width = static_cast<int>(feature_.size());
    for (int j = 0; j < k_; ++j) {
      const T* at = in.neighbors + 3 * std::size_t{neighbor[j]};
      d[0][j] = centre[1] - at[1];
      d[1][j] = centre[2] - at[2];
      d[2][j] = centre[0] - at[0];
      const T* f = in.features + neighbor[j] * in.feature_stride;
      for (int c = 0; c < width; ++c) feature_[c][j] = f[c];
    }
    const Edges square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    const Edges scale =
        (square > 0).select(square.sqrt().max(static_cast<T>(ops::direction_eps)).inverse(), Edges::Zero());
    for (int a = 0; a < 3; ++a) direction_[a] = d[a] * scale;
    square_ = square * scale * scale;
    if (!(square.head(k_) == 0).any()) return false;

    zero_ = (square == 0).template cast<T>();
    zero_.tail(Width - k_).setZero();
    for (int c = 0; c < width; ++c) {
      zero_feature_[c] = feature_[c] * zero_;
      feature_[c] -= zero_feature_[c];
    }
    return true;
  }

  // φ of every edge: the Clebsch–Gordan products of direction and feature.
  void products() {
    static const T k0 = static_cast<T>(-1 / std::sqrt(3.0)), k1 = static_cast<T>(1 / std::sqrt(2.0)),
                   k2 = static_cast<T>(1 / std::sqrt(6.0));
    const Edges* v = direction_;
    const int c0 = op_.c0, c1 = op_.c1;
    for (int c = 0; c < c0; ++c) phi0_[c] = feature_[c];
    for (int c = 0; c < c1; ++c) {
      const Edges* f = &feature_[c0 + 3 * c];
      phi0_[c0 + c] = v[0] * f[0] + v[1] * f[1] + v[2] * f[2];
    }
    if (op_.direction)
      for (int a = 0; a < 3; ++a) phi0_[c0 + c1 + a] = v[a];
    if (n1_ == 0) return;
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, c = (a + 2) % 3;
      Edges* phi = &phi1_[a * n1_];
      for (int i = 0; i < c0; ++i) phi[i] = v[a] * feature_[i];
      for (int i = 0; i < c1; ++i) {
        const Edges* f = &feature_[c0 + 3 * i];
        phi[c0 + i] = k0 * f[a];
        phi[c0 + c1 + i] = k1 * (v[b] * f[c] - v[c] * f[b]);
        phi[c0 + 2 * c1 + i] = k2 * (3 * v[a] * phi0_[c0 + i] - square_ * f[a]);
      }
    }
  }

  // Adds ⟨Q_h, φ_j⟩ to the logits, Q = M f.
  void score(const SmallMatrix<T>& M0, const SmallMatrix<T>& M1, const T* own, const Buffer& phi0, int n0,
             const Buffer& phi1, int n1) {
    const int heads = op_.heads;
    std::fill(query_.begin(), query_.end(), T{0});
    M0.add_affine(own, query_.data());
    T* query1 = query_.data() + heads * n0;
    if (!M1.empty())
      for (int a = 0; a < 3; ++a) M1.add_product(component(own, a), query1 + a * heads * n1);
    for (int h = 0; h < heads; ++h) {
      Edges logit = weight_[h];
      for (int p = 0; p < n0; ++p) logit += query_[h * n0 + p] * phi0[p];
      if (!M1.empty())
        for (int a = 0; a < 3; ++a)
          for (int p = 0; p < n1; ++p) logit += query1[(a * heads + h) * n1 + p] * phi1[a * n1 + p];
      weight_[h] = logit;
    }
  }

  // Component a of the vectors f¹, channel by channel.
  const T* component(const T* own, int a) {
    for (int c = 0; c < op_.c1; ++c) component_[c] = own[op_.c0 + 3 * c + a];
    return component_.data();
  }

  void score_zero(const PointCoefficients<T>& coefficients, const T* own) {
    spread_zero();
    score(coefficients.Mz0, coefficients.Mz1, own, zero_phi0_, z0_, zero_phi1_, z1_);
  }

  // φᶻ in the layout of φ.
  void spread_zero() {
    zero_phi0_.assign(zero_feature_.begin(), zero_feature_.begin() + op_.c0);
    zero_phi0_.push_back(zero_);
    zero_phi1_.clear();
    for (int a = 0; a < 3 && z1_ > 0; ++a)
      for (int c = 0; c < op_.c1; ++c) zero_phi1_.push_back(zero_feature_[op_.c0 + 3 * c + a]);
  }

  void softmax() {
    for (Edges& e : weight_) {
      e = (e - e.head(k_).maxCoeff()).exp();
      e.tail(Width - k_).setZero();
      e /= e.sum();
    }
  }

  void self(const PointCoefficients<T>& coefficients, const T* own, T* out) {
    coefficients.S0.add_affine(own, out);
    if (coefficients.S1.empty()) return;
    for (int a = 0; a < 3; ++a) coefficients.S1.add_product(component(own, a), out + op_.m0 + a, 3);
  }

  void aggregate(const SmallMatrix<T>& O0, const SmallMatrix<T>& O1, const Buffer& phi0, int n0,
                 const Buffer& phi1, int n1, T* out) {
    const int heads = op_.heads;
    for (int h = 0; h < heads; ++h)
      for (int p = 0; p < n0; ++p) sum_[h * n0 + p] = (weight_[h] * phi0[p]).sum();
    O0.add_product(sum_.data(), out);
    for (int a = 0; a < 3 && n1 > 0; ++a) {
      for (int h = 0; h < heads; ++h)
        for (int p = 0; p < n1; ++p) sum_[h * n1 + p] = (weight_[h] * phi1[a * n1 + p]).sum();
      O1.add_product(sum_.data(), out + op_.m0 + a, 3);
    }
  }

  void aggregate_zero(const PointCoefficients<T>& coefficients, T* out) {
    spread_zero();
    aggregate(coefficients.Oz0, coefficients.Oz1, zero_phi0_, z0_, zero_phi1_, z1_, out);
  }

  const ops::PointAttention& op_;
  const RowMatrix<T>& plane_;
  const int k_, n0_, n1_, z0_, z1_;
  Buffer feature_, phi0_, phi1_, zero_feature_, zero_phi0_, zero_phi1_, weight_;
  std::vector<T> query_, sum_, component_;
  Edges direction_[3], square_, zero_;  // v, |v|² (1, but for the floor of the direction's norm)
};

template <class T, int Width>
void rows_of_width(const ops::PointAttention& op, const PointCoefficients<T>& coefficients,
                   const RowMatrix<T>& plane, const PointInputs<T>& inputs, int k, std::size_t begin,
                   std::size_t end) {
  PointRow<T, Width> point(op, plane, k);
  for (std::size_t row = begin; row < end; ++row) point.evaluate(coefficients, inputs, row);
}

}  // namespace

template <class T>
PointCoefficients<T>::PointCoefficients(const ops::PointAttention& op)
    : M0(op.M0),
      M1(op.M1),
      O0(op.O0),
      O1(op.O1),
      S0(op.S0),
      S1(op.S1),
      Mz0(op.Mz0),
      Mz1(op.Mz1),
      Oz0(op.Oz0),
      Oz1(op.Oz1) {}

template <class T>
PointCoefficients<T>::PointCoefficients(const ops::PointAttention& op, const T* row) {
  const auto take = [&row](int rows, int cols) {
    const Eigen::Map<const RowMatrix<T>> block(row, rows, cols);
    row += rows * cols;
    return SmallMatrix<T>(block);
  };
  const int from = op.c0 + 1, paths = op.heads * op.n0(), zero_paths = op.heads * from;
  M0 = take(paths, from);
  O0 = take(op.m0, paths);
  S0 = take(op.m0, from);
  Mz0 = take(zero_paths, from);
  Oz0 = take(op.m0, zero_paths);
}

template <class T>
void point_attention_rows(const ops::PointAttention& op, const PointCoefficients<T>& coefficients,
                          const RowMatrix<T>& plane, const PointInputs<T>& inputs, int k, std::size_t begin,
                          std::size_t end) {
  const auto run = k <= 8    ? rows_of_width<T, 8>
                   : k <= 16 ? rows_of_width<T, 16>
                   : k <= 24 ? rows_of_width<T, 24>
                   : k <= 32 ? rows_of_width<T, 32>
                             : rows_of_width<T, 64>;
  run(op, coefficients, plane, inputs, k, begin, end);
}

template struct PointCoefficients<float>;
template struct PointCoefficients<double>;
template void point_attention_rows(const ops::PointAttention&, const PointCoefficients<float>&,
                                   const RowMatrix<float>&, const PointInputs<float>&, int, std::size_t,
                                   std::size_t);
template void point_attention_rows(const ops::PointAttention&, const PointCoefficients<double>&,
                                   const RowMatrix<double>&, const PointInputs<double>&, int, std::size_t,
                                   std::size_t);

namespace {

constexpr std::size_t rows_per_task = 64;

template <class T>
class PointAttentionKernel : public Kernel<T> {
 public:
  explicit PointAttentionKernel(const ops::PointAttention& op)
      : op_(op), coefficients_(op), plane_(op.plane.cast<T>()) {}

  void run(const Arguments& args) const override {
    const Slot &features = args.in[0], &edges = args.in[1], &out = args.out[0];
    const PointInputs<T> inputs{features.as<T>(),   features.stride(),  edges.as<std::uint32_t>(),
                                args.in[2].as<T>(), args.in[3].as<T>(), out.as<T>()};
    const auto rows = [&](const PointCoefficients<T>& coefficients, std::size_t first, std::size_t count) {
      args.pool.parallel_for(count, rows_per_task, [&](std::size_t begin, std::size_t end) {
        point_attention_rows(op_, coefficients, plane_, inputs, edges.per_row, first + begin, first + end);
      });
    };
    if (!op_.per_cloud) return rows(coefficients_, 0, args.rows(out));
    for (std::uint32_t cloud = 0; cloud < args.layout.clouds(); ++cloud) {
      const PointCoefficients<T> coefficients(op_, args.in[4].as<T>() + cloud * args.in[4].stride());
      const std::size_t first = args.layout.cloud_offset[cloud];
      rows(coefficients, first, args.layout.cloud_offset[cloud + 1] - first);
    }
  }

 private:
  const ops::PointAttention op_;
  const PointCoefficients<T> coefficients_;
  const RowMatrix<T> plane_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::PointAttention& op) {
  return std::make_unique<PointAttentionKernel<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::PointAttention& op) {
  return std::make_unique<PointAttentionKernel<double>>(op);
}

}  // namespace bitr::cpu
