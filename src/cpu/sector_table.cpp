#include "cpu/sector_table.hpp"

#include <cmath>
#include <cstdint>
#include <type_traits>

namespace bitr::cpu {

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
  Eigen::Map<Column> to(coefficients + begin_, size_);
  if (scale_degree_ == 1) {
    const std::size_t s = find(r1, r2);
    to += r1 * slopes_.col(2 * s) + r2 * slopes_.col(2 * s + 1);
    return;
  }
  const T variance = q_[0] * r1 * r1 + q_[1] * r1 * r2 + q_[2] * r2 * r2;
  if (!(variance > trusted_)) return add_network(r1, r2, to.data());
  const std::size_t s = find(r1, r2);
  const T scale = 1 / std::sqrt(variance + eps_);
  const T x = r1 * scale, y = r2 * scale;
  const auto& Q = Q_[s];
  const T second = Q[0] * x * x + Q[1] * x * y + Q[2] * y * y + Q[3] * x + Q[4] * y + Q[5];
  if (!(second > trusted_)) return add_network(r1, r2, to.data());
  const T v = 1 / std::sqrt(second + eps_);
  to += (x * v) * slopes_.col(3 * s) + (y * v) * slopes_.col(3 * s + 1) + v * slopes_.col(3 * s + 2) +
        offsets_.col(s);
}

template <class T>
void Sectors<T>::add_gradient(T r1, T r2, const T* coefficients, T* table, T& d_r1, T& d_r2) const {
  T *d_first = &d_r1, *d_second = &d_r2;
  if (swapped_) {
    std::swap(r1, r2);
    std::swap(d_first, d_second);
  }
  const Eigen::Map<const Column> d(coefficients + begin_, size_);
  const auto add_column = [&](T* to, T factor) { Eigen::Map<Column>(to, size_) += factor * d; };
  if (scale_degree_ == 1) {
    const std::size_t s = find(r1, r2);
    T* slope = table + s * 2 * static_cast<std::size_t>(size_);
    add_column(slope, r1);
    add_column(slope + size_, r2);
    *d_first += (d * slopes_.col(2 * s)).sum();
    *d_second += (d * slopes_.col(2 * s + 1)).sum();
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

  const std::size_t size = static_cast<std::size_t>(size_), sector = 4 * size + Q.size();
  T* slope = table + s * sector;
  add_column(slope, x * v);
  add_column(slope + size, y * v);
  add_column(slope + 2 * size, v);
  add_column(slope + 3 * size, 1);
  const T b0 = (d * slopes_.col(3 * s)).sum(), b1 = (d * slopes_.col(3 * s + 1)).sum(),
          b2 = (d * slopes_.col(3 * s + 2)).sum();
  const T d_form = static_cast<T>(-0.5) * v * v * v * (x * b0 + y * b1 + b2);
  T* d_Q = slope + 4 * size;
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
