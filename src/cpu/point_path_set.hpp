// Sums over the edges of a block of points, one point per lane, channel by channel of the neighbours'
// features.
#pragma once

#include "cpu/pack.hpp"
#include "cpu/point_paths.hpp"
#include "ops/point_attention.hpp"

namespace bitr::cpu {

/// The paths of edges that have a direction (φ of ops/point_attention.hpp), or of those that have none (φᶻ).
template <class T>
class PointPathSet {
  using P = Pack<T>;

 public:
  PointPathSet(const ops::PointAttention& op, bool zero, int k)
      : heads_(op.heads),
        k_(k),
        n0_(zero ? op.c0 + 1 : op.n0()),
        n1_(op.m1 == 0 ? 0
            : zero     ? op.c1
                       : op.n1()),
        inputs_(op.c0 + 3 * op.c1 + (zero ? 1 : 0)),
        features_(static_cast<std::size_t>(inputs_ * k)),
        gradient_(features_.size()) {
    if (zero)
      add_zero_channels(op);
    else
      add_channels(op);
  }

  int inputs() const { return inputs_; }
  int count() const { return heads_ * (n0_ + 3 * n1_); }
  /// Degree 0: heads × n₀; degree 1: 3 × heads × n₁.
  int degree1(int axis) const { return heads_ * (n0_ + axis * n1_); }
  int axis_step() const { return heads_ * n1_; }
  int axes() const { return n1_ > 0 ? 3 : 0; }
  /// Inputs of the paths over edge j, and the gradient with respect to them.
  P* features(int j) { return features_.data() + j * inputs_; }
  P* gradient(int j) { return gradient_.data() + j * inputs_; }

  /// target[j, h] += ⟨coefficients_h, φ_j⟩
  void add_products(const P* coefficients, const P* directions, P* target) const {
    for_each_channel([&](auto paths, auto heads, const Channel& channel, int h) {
      using Paths = decltype(paths);
      constexpr int count = decltype(heads)::value;
      P q[count][Paths::paths], phi[Paths::paths];
      channel.load(coefficients, h, q);
      for (int j = 0; j < k_; ++j) {
        Paths::products(&features_[j * inputs_ + channel.input], directions + 3 * j, phi);
        for (int i = 0; i < count; ++i) {
          P sum = target[j * heads_ + h + i];
          for (int p = 0; p < Paths::paths; ++p) sum += q[i][p] * phi[p];
          target[j * heads_ + h + i] = sum;
        }
      }
    });
  }

  /// sums_h = Σ_j weights[j, h] φ_j
  void sum(const P* weights, const P* directions, P* sums) const {
    for_each_channel([&](auto paths, auto heads, const Channel& channel, int h) {
      using Paths = decltype(paths);
      constexpr int count = decltype(heads)::value;
      P total[count][Paths::paths], phi[Paths::paths];
      for (auto& row : total) std::fill(std::begin(row), std::end(row), zero_pack<T>());
      for (int j = 0; j < k_; ++j) {
        Paths::products(&features_[j * inputs_ + channel.input], directions + 3 * j, phi);
        for (int i = 0; i < count; ++i)
          for (int p = 0; p < Paths::paths; ++p) total[i][p] += weights[j * heads_ + h + i] * phi[p];
      }
      for (int i = 0; i < count; ++i)
        for (int p = 0; p < Paths::paths; ++p) sums[channel.at(p, h + i)] = total[i][p];
    });
  }

  /// Writes gradient() where dφ_j = Σ_h a[j, h] x_h + b[j, h] y_h; adds the gradient of the directions unless
  /// nullptr.
  void differentiate(const P* a, const P* x, const P* b, const P* y, const P* directions, P* d_directions) {
    for_each_channel([&](auto paths, auto heads, const Channel& channel, int h) {
      using Paths = decltype(paths);
      constexpr int count = decltype(heads)::value;
      P xs[count][Paths::paths], ys[count][Paths::paths], g[Paths::paths], df[3], dv[3];
      channel.load(x, h, xs);
      channel.load(y, h, ys);
      const auto edge = [&](int j) {
        for (int p = 0; p < Paths::paths; ++p) {
          g[p] = a[j * heads_ + h] * xs[0][p] + b[j * heads_ + h] * ys[0][p];
          for (int i = 1; i < count; ++i)
            g[p] += a[j * heads_ + h + i] * xs[i][p] + b[j * heads_ + h + i] * ys[i][p];
        }
        const int input = j * inputs_ + channel.input;
        Paths::adjoint(g, &features_[input], directions + 3 * j, df, dv);
        for (int i = 0; i < Paths::inputs; ++i)
          gradient_[input + i] = h == 0 ? df[i] : gradient_[input + i] + df[i];
      };
      if (d_directions == nullptr)
        for (int j = 0; j < k_; ++j) edge(j);
      else
        for (int j = 0; j < k_; ++j) {
          edge(j);
          if constexpr (Paths::directed)
            for (int i = 0; i < 3; ++i) d_directions[3 * j + i] += dv[i];
        }
    });
  }

 private:
  enum class Kind { identity, scalar, along, vector, direction };

  struct Channel {
    Kind kind;
    int input;               // first of its inputs
    std::vector<int> begin;  // where each path begins for head 0
    std::vector<int> step;   // from head to head

    int at(int path, int head) const { return begin[path] + head * step[path]; }
    template <int Heads, int Paths>
    void load(const P* from, int head, P (&to)[Heads][Paths]) const {
      for (int h = 0; h < Heads; ++h)
        for (int p = 0; p < Paths; ++p) to[h][p] = from[at(p, head + h)];
    }
  };

  Channel& add(Kind kind, int input) {
    channels_.push_back({kind, input, {}, {}});
    return channels_.back();
  }
  void add_path0(Channel& channel, int path) const {
    channel.begin.push_back(path);
    channel.step.push_back(n0_);
  }
  void add_path1(Channel& channel, int path, int axis) const {
    channel.begin.push_back(degree1(axis) + path);
    channel.step.push_back(n1_);
  }

  void add_channels(const ops::PointAttention& op) {
    const int c0 = op.c0, c1 = op.c1;
    for (int c = 0; c < c0; ++c) {
      Channel& channel = add(n1_ > 0 ? Kind::scalar : Kind::identity, c);
      add_path0(channel, c);
      for (int a = 0; a < axes(); ++a) add_path1(channel, c, a);
    }
    for (int c = 0; c < c1; ++c) {
      Channel& channel = add(n1_ > 0 ? Kind::vector : Kind::along, c0 + 3 * c);
      add_path0(channel, c0 + c);
      for (int block = 0; block < axes(); ++block)
        for (int a = 0; a < 3; ++a) add_path1(channel, c0 + block * c1 + c, a);
    }
    if (!op.direction) return;
    Channel& channel = add(Kind::direction, 0);
    for (int a = 0; a < 3; ++a) add_path0(channel, c0 + c1 + a);
  }

  // (f⁰, f¹, 1), the paths being (f⁰, 1; f¹).
  void add_zero_channels(const ops::PointAttention& op) {
    for (int c = 0; c < op.c0; ++c) add_path0(add(Kind::identity, c), c);
    add_path0(add(Kind::identity, inputs_ - 1), op.c0);
    for (int c = 0; c < n1_; ++c)
      for (int a = 0; a < 3; ++a) add_path1(add(Kind::identity, op.c0 + 3 * c + a), c, a);
  }

  // body(paths, number of heads, channel, first head)
  template <class Body>
  void for_each_channel(const Body& body) const {
    for (const Channel& channel : channels_)
      for (int h = 0; h < heads_; h += 2)
        if (h + 1 < heads_)
          with_paths<2>(channel, h, body);
        else
          with_paths<1>(channel, h, body);
  }
  template <int Heads, class Body>
  static void with_paths(const Channel& channel, int h, const Body& body) {
    constexpr std::integral_constant<int, Heads> heads;
    switch (channel.kind) {
      case Kind::identity:
        return body(Identity<P>{}, heads, channel, h);
      case Kind::scalar:
        return body(ScalarPaths<P>{}, heads, channel, h);
      case Kind::along:
        return body(Along<P>{}, heads, channel, h);
      case Kind::vector:
        return body(VectorPaths<P>{}, heads, channel, h);
      case Kind::direction:
        return body(Direction<P>{}, heads, channel, h);
    }
  }

  const int heads_, k_, n0_, n1_, inputs_;
  std::vector<Channel> channels_;
  Packs<T> features_, gradient_;
};

}  // namespace bitr::cpu
