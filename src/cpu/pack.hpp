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

namespace detail {

template <class T, int distance, int... lane>
void exchange(Pack<T>& a, Pack<T>& b, std::integer_sequence<int, lane...>) {
  constexpr int lanes = sizeof...(lane);
  const Pack<T> first =
      __builtin_shufflevector(a, b, (lane & distance ? lanes + (lane ^ distance) : lane)...);
  b = __builtin_shufflevector(a, b, (lane & distance ? lanes + lane : lane ^ distance)...);
  a = first;
}

}  // namespace detail

/// Lane i of pack j becomes lane j of pack i, of as many packs as there are lanes.
template <class T, int distance = pack_lanes<T> / 2>
void transpose(Pack<T>* packs) {
#pragma GCC unroll 16
  for (int i = 0; i < pack_lanes<T>; ++i)
    if ((i & distance) == 0)
      detail::exchange<T, distance>(packs[i], packs[i + distance],
                                    std::make_integer_sequence<int, pack_lanes<T>>{});
  if constexpr (distance > 1) transpose<T, distance / 2>(packs);
}

/// columns[c] = row[lane][c]
template <class T>
void gather(const T* const* row, int width, Pack<T>* columns) {
  constexpr int lanes = pack_lanes<T>;
  int c = 0;
  for (; c + lanes <= width; c += lanes) {
    Pack<T> block[lanes];
    for (int lane = 0; lane < lanes; ++lane) std::memcpy(&block[lane], row[lane] + c, pack_bytes);
    transpose<T>(block);
    std::copy_n(block, lanes, columns + c);
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
    Pack<T> block[lanes];
    std::copy_n(columns + c, lanes, block);
    transpose<T>(block);
    for (int lane = 0; lane < count; ++lane) {
      Pack<T> sum;
      std::memcpy(&sum, row[lane] + c, pack_bytes);
      sum += block[lane];
      std::memcpy(row[lane] + c, &sum, pack_bytes);
    }
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
  /// The gradient of y = M x from that of y: of M, and added to that of x.
  void differentiate(const Pack<T>* dy, const Pack<T>* x, Pack<T>* dx) {
    for (int r = 0; r < rows_; ++r) {
      const Pack<T> g = dy[r];
      const T* row = values_.data() + at(r, 0);
      Pack<T>* gradient = gradient_.data() + at(r, 0);
      for (int c = 0; c < cols_; ++c) {
        gradient[c] += g * x[c];
        dx[c] += row[c] * g;
      }
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
