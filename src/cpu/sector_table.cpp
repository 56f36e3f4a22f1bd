#include "cpu/sector_table.hpp"

#include <cmath>
#include <cstdint>
#include <type_traits>

namespace bitr::cpu {
namespace {

// Calls work(i, lanes) for blocks of eight numbers, and one by one for the rest. Eigen's own loops over
// short, unaligned columns would go one by one throughout.
template <class T, class Work>
void for_blocks(int size, Work work) {
  int i = 0;
  for (; i + lane_count <= size; i += lane_count) work(i, std::type_identity<Lanes<T>>{});
  for (; i < size; ++i) work(i, std::type_identity<Eigen::Array<T, 1, 1>>{});
}

template <class Block, class T>
auto block(T* numbers, int i) {
  if constexpr (std::is_const_v<T>)
    return Eigen::Map<const Block>(numbers + i);
  else
    return Eigen::Map<Block>(numbers + i);
}

}  // namespace

template <class T>
Sectors<T>::Sectors(const ops::SectorTable& table)
    : scale_degree_(table.scale_degree),
      size_(table.size),
      swapped_(table.swapped),
      begin_(table.begin),
      eps_(static_cast<T>(table.network->eps)),
      trusted_(static_cast<T>(1e4 * table.network->eps)),
      network_(*table.network),
      basis_((table.scale * table.basis).cast<T>()) {
  const int columns = scale_degree_ == 1 ? 2 : 3;
  for (const auto& ray : table.rays) {
    ray_cos_.push_back(static_cast<T>(ray[0]));
    ray_sin_.push_back(static_cast<T>(ray[1]));
  }
  slopes_.resize(size_, columns * static_cast<Eigen::Index>(table.sectors()));
  offsets_.resize(size_, static_cast<Eigen::Index>(table.offset.size()));
  for (std::size_t s = 0; s < table.sectors(); ++s) {
    slopes_.middleCols(columns * s, columns) = table.slope[s].array().cast<T>();
    if (scale_degree_ == 1) continue;
    offsets_.col(s) = table.offset[s].array().cast<T>();
    std::array<T, 6> form;
    for (int i = 0; i < 6; ++i) form[i] = static_cast<T>(table.Q[s][i]);
    Q_.push_back(form);
  }
  for (int i = 0; i < 3; ++i) q_[i] = static_cast<T>(table.q[i]);
}

template <class T>
std::size_t Sectors<T>::find(T r1, T r2) const {
  // As wide as T, so that the count vectorises with the comparison.
  std::conditional_t<sizeof(T) == 4, std::int32_t, std::int64_t> sector = 0;
  for (std::size_t i = 0; i < ray_cos_.size(); ++i) sector += r2 * ray_cos_[i] > r1 * ray_sin_[i];
  return static_cast<std::size_t>(sector);
}

template <class T>
void Sectors<T>::add(T r1, T r2, T* coefficients) const {
  if (swapped_) std::swap(r1, r2);
  T* to = coefficients + begin_;
  if (scale_degree_ == 1) {
    const T* slope = slopes_.data() + 2 * find(r1, r2) * static_cast<std::size_t>(size_);
    for_blocks<T>(size_, [&]<class Block>(int i, std::type_identity<Block>) {
      block<Block>(to, i) += r1 * block<Block>(slope, i) + r2 * block<Block>(slope + size_, i);
    });
    return;
  }
  const T variance = q_[0] * r1 * r1 + q_[1] * r1 * r2 + q_[2] * r2 * r2;
  if (!(variance > trusted_)) return add_network(r1, r2, to);
  const std::size_t s = find(r1, r2);
  const T scale = 1 / std::sqrt(variance + eps_);
  const T x = r1 * scale, y = r2 * scale;
  const auto& Q = Q_[s];
  const T second = Q[0] * x * x + Q[1] * x * y + Q[2] * y * y + Q[3] * x + Q[4] * y + Q[5];
  if (!(second > trusted_)) return add_network(r1, r2, to);
  const T v = 1 / std::sqrt(second + eps_);
  const T xv = x * v, yv = y * v;
  const T* slope = slopes_.data() + 3 * s * static_cast<std::size_t>(size_);
  const T* offset = offsets_.data() + s * static_cast<std::size_t>(size_);
  for_blocks<T>(size_, [&]<class Block>(int i, std::type_identity<Block>) {
    block<Block>(to, i) += xv * block<Block>(slope, i) + yv * block<Block>(slope + size_, i) +
                           v * block<Block>(slope + 2 * size_, i) + block<Block>(offset, i);
  });
}

template <class T>
void Sectors<T>::add_gradient(T r1, T r2, const T* coefficients, T* table, T& d_r1, T& d_r2) const {
  T *d_first = &d_r1, *d_second = &d_r2;
  if (swapped_) {
    std::swap(r1, r2);
    std::swap(d_first, d_second);
  }
  const T* d = coefficients + begin_;
  const std::size_t size = static_cast<std::size_t>(size_);
  // Adds factor · d to column `column` of `to`, and returns ⟨d, that column of `of`⟩.
  const auto column = [&](T* to, const T* of, std::size_t at, T factor) {
    Lanes<T> lanes = Lanes<T>::Zero();
    T rest = 0;
    for_blocks<T>(size_, [&]<class Block>(int i, std::type_identity<Block>) {
      const Block d_i = block<Block>(d, i);
      block<Block>(to + at * size, i) += factor * d_i;
      const Block product = d_i * block<Block>(of + at * size, i);
      if constexpr (std::is_same_v<Block, Lanes<T>>)
        lanes += product;
      else
        rest += product[0];
    });
    return lanes.sum() + rest;
  };
  if (scale_degree_ == 1) {
    const std::size_t s = find(r1, r2);
    T* to = table + s * 2 * size;
    const T* of = slopes_.data() + s * 2 * size;
    *d_first += column(to, of, 0, r1);
    *d_second += column(to, of, 1, r2);
    return;
  }
  const T variance = q_[0] * r1 * r1 + q_[1] * r1 * r2 + q_[2] * r2 * r2;
  if (!(variance > trusted_)) return;
  const std::size_t s = find(r1, r2);
  const T scale = 1 / std::sqrt(variance + eps_);
  const T x = r1 * scale, y = r2 * scale;
  const auto& Q = Q_[s];
  const T second = Q[0] * x * x + Q[1] * x * y + Q[2] * y * y + Q[3] * x + Q[4] * y + Q[5];
  if (!(second > trusted_)) return;
  const T v = 1 / std::sqrt(second + eps_);

  const std::size_t sector = 4 * size + Q.size();
  T* to = table + s * sector;
  const T* of = slopes_.data() + 3 * s * size;
  const T b0 = column(to, of, 0, x * v), b1 = column(to, of, 1, y * v), b2 = column(to, of, 2, v);
  for_blocks<T>(size_, [&]<class Block>(int i, std::type_identity<Block>) {
    block<Block>(to + 3 * size, i) += block<Block>(d, i);
  });
  const T d_form = static_cast<T>(-0.5) * v * v * v * (x * b0 + y * b1 + b2);
  T* d_Q = to + 4 * size;
  const T monomials[6] = {x * x, x * y, y * y, x, y, 1};
  for (int i = 0; i < 6; ++i) d_Q[i] += d_form * monomials[i];
  const T d_x = v * b0 + d_form * (2 * Q[0] * x + Q[1] * y + Q[3]),
          d_y = v * b1 + d_form * (Q[1] * x + 2 * Q[2] * y + Q[4]);
  const T d_variance = static_cast<T>(-0.5) * scale * scale * scale * (d_x * r1 + d_y * r2);
  T* d_q = table + Q_.size() * sector;
  d_q[0] += d_variance * r1 * r1;
  d_q[1] += d_variance * r1 * r2;
  d_q[2] += d_variance * r2 * r2;
  *d_first += d_x * scale + d_variance * (2 * q_[0] * r1 + q_[1] * r2);
  *d_second += d_y * scale + d_variance * (q_[1] * r1 + 2 * q_[2] * r2);
}

template <class T>
void Sectors<T>::add_network(T r1, T r2, T* to) const {
  typename Radial<T>::Matrix lengths(2, 1);
  lengths << r1, r2;
  const typename Radial<T>::Matrix raw = network_.evaluate(lengths);
  const auto freq = basis_.cols();
  const Eigen::Index channels = size_ / freq;
  for (Eigen::Index target = 0; target < freq; ++target)
    for (Eigen::Index c = 0; c < channels; ++c)
      for (Eigen::Index f = 0; f < freq; ++f)
        to[target * channels + c] += basis_(target, f) * raw(c * freq + f);
}

template class Sectors<float>;
template class Sectors<double>;

}  // namespace bitr::cpu
