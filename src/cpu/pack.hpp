// A register of numbers, one row of points per lane, and small matrices whose entries are the same in all
// lanes.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstring>
#include <utility>
#include <vector>

namespace bitr::cpu {

constexpr std::size_t pack_bytes = std::max(EIGEN_MAX_STATIC_ALIGN_BYTES, 16);
template <class T>
constexpr int pack_lanes = static_cast<int>(pack_bytes / sizeof(T));
template <class T>
struct PackOf {
  typedef T type __attribute__((vector_size(pack_bytes)));
};
template <class T>
using Pack = typename PackOf<T>::type;
template <class T>
using Packs = std::vector<Pack<T>>;

template <class T>
Eigen::Map<Eigen::Array<T, pack_lanes<T>, 1>> as_array(Pack<T>& pack) {
  return Eigen::Map<Eigen::Array<T, pack_lanes<T>, 1>>(reinterpret_cast<T*>(&pack));
}
template <class T>
Pack<T> zero_pack() {
  return Pack<T>{} + T{0};
}

/// Lane i of pack j becomes lane j of pack i. Everything is inlined: the packs stay in registers.
template <class T>
class Transpose {
  using P = Pack<T>;
  static constexpr int lanes = pack_lanes<T>;
  using Sequence = std::make_integer_sequence<int, lanes>;

 public:
  P pack[lanes];

  [[gnu::always_inline]] void run() { stage<lanes / 2>(Sequence{}); }
  /// body(std::integral_constant) of every pack.
  template <class Body>
  [[gnu::always_inline]] static void for_each(const Body& body) {
    call(body, Sequence{});
  }

 private:
  template <class Body, int... i>
  [[gnu::always_inline]] static void call(const Body& body, std::integer_sequence<int, i...>) {
    (body(std::integral_constant<int, i>{}), ...);
  }
  template <int distance, int... i>
  [[gnu::always_inline]] void stage(std::integer_sequence<int, i...>) {
    (exchange<i, distance>(Sequence{}), ...);
    if constexpr (distance > 1) stage<distance / 2>(Sequence{});
  }
  template <int i, int distance, int... lane>
  [[gnu::always_inline]] void exchange(std::integer_sequence<int, lane...>) {
    if constexpr ((i & distance) == 0) {
      P &a = pack[i], &b = pack[i + distance];
      const P first = __builtin_shufflevector(a, b, (lane & distance ? lanes + (lane ^ distance) : lane)...);
      b = __builtin_shufflevector(a, b, (lane & distance ? lanes + lane : lane ^ distance)...);
      a = first;
    }
  }
};

/// columns[c] = row[lane][c]
template <class T>
void gather(const T* const* row, int width, Pack<T>* columns) {
  constexpr int lanes = pack_lanes<T>;
  int c = 0;
  for (; c + lanes <= width; c += lanes) {
    Transpose<T> block;
    block.for_each([&](auto i) { std::memcpy(&block.pack[i], row[i] + c, pack_bytes); });
    block.run();
    block.for_each([&](auto i) { columns[c + i] = block.pack[i]; });
  }
  for (; c < width; ++c)
    for (int lane = 0; lane < lanes; ++lane) columns[c][lane] = row[lane][c];
}

/// row[lane][c] += columns[c], of the first `count` lanes in order; rows may be the same.
template <class T>
void scatter(const Pack<T>* columns, int width, int count, T* const* row) {
  constexpr int lanes = pack_lanes<T>;
  int c = 0;
  for (; c + lanes <= width; c += lanes) {
    Transpose<T> block;
    block.for_each([&](auto i) { block.pack[i] = columns[c + i]; });
    block.run();
    block.for_each([&](auto i) {
      if (i >= count) return;
      Pack<T> sum;
      std::memcpy(&sum, row[i] + c, pack_bytes);
      sum += block.pack[i];
      std::memcpy(row[i] + c, &sum, pack_bytes);
    });
  }
  for (; c < width; ++c)
    for (int lane = 0; lane < count; ++lane) row[lane][c] += columns[c][lane];
}

/// A matrix and the gradient of a loss with respect to it, lane by lane.
template <class T>
class PackMatrix {
 public:
  PackMatrix() = default;
  explicit PackMatrix(const Eigen::MatrixXd& matrix)
      : rows_(static_cast<int>(matrix.rows())),
        cols_(static_cast<int>(matrix.cols())),
        values_(static_cast<std::size_t>(matrix.size())),
        gradient_(values_.size(), zero_pack<T>()) {
    for (int r = 0; r < rows_; ++r)
      for (int c = 0; c < cols_; ++c) values_[at(r, c)] = static_cast<T>(matrix(r, c));
  }
  bool empty() const { return values_.empty(); }

  /// y += M x
  void add_product(const Pack<T>* x, Pack<T>* y) const {
    for (int r = 0; r < rows_; ++r) {
      Pack<T> sum = y[r];
      for (int c = 0; c < cols_; ++c) sum += values_[at(r, c)] * x[c];
      y[r] = sum;
    }
  }
  /// The gradient of y = M x from that of y: of M, and added to that of x. `axes` products, their x, dx and
  /// dy x_step and y_step apart.
  void differentiate(const Pack<T>* dy, const Pack<T>* x, Pack<T>* dx, int axes = 1, int y_step = 0,
                     int x_step = 0) {
    for (int r = 0; r < rows_; ++r)
      for (int c = 0; c < cols_; ++c) {
        Pack<T> sum = gradient_[at(r, c)];
        for (int a = 0; a < axes; ++a) sum += dy[a * y_step + r] * x[a * x_step + c];
        gradient_[at(r, c)] = sum;
      }
    for (int a = 0; a < axes; ++a)
      for (int c = 0; c < cols_; ++c) {
        Pack<T> sum = dx[a * x_step + c];
        for (int r = 0; r < rows_; ++r) sum += values_[at(r, c)] * dy[a * y_step + r];
        dx[a * x_step + c] = sum;
      }
  }
  T value(int r, int c) const { return values_[at(r, c)]; }
  Pack<T>& gradient(int r, int c) { return gradient_[at(r, c)]; }

  /// Moves the gradient, summed over the lanes, into `sum`.
  void flush(Eigen::MatrixXd& sum) {
    for (int r = 0; r < rows_; ++r)
      for (int c = 0; c < cols_; ++c) {
        Pack<T>& lanes = gradient_[at(r, c)];
        sum(r, c) += as_array<T>(lanes).template cast<double>().sum();
        lanes = zero_pack<T>();
      }
  }

 private:
  std::size_t at(int r, int c) const { return static_cast<std::size_t>(r * cols_ + c); }

  int rows_ = 0, cols_ = 0;
  std::vector<T> values_;
  Packs<T> gradient_;
};

}  // namespace bitr::cpu
