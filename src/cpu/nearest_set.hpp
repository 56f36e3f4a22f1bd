// The k nearest of the points that a search comes upon, in order.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <vector>

#include "cpu/kernel.hpp"

namespace bitr::cpu {

/// The first of equally far points comes first.
template <class T>
struct Candidate {
  T distance = 0;
  std::uint32_t index = 0;
  bool operator<(const Candidate& other) const {
    return distance < other.distance || (distance == other.distance && index < other.index);
  }
};

// The same order in one integer: the bits of non-negative floats sort like their values.
template <>
struct Candidate<float> {
  std::uint64_t key;
  Candidate() = default;
  Candidate(float distance, std::uint32_t index)
      : key(std::uint64_t{std::bit_cast<std::uint32_t>(distance)} << 32 | index) {}
  bool operator<(const Candidate& other) const { return key < other.key; }
};

template <class T>
std::uint32_t index_of(const Candidate<T>& candidate) {
  if constexpr (std::is_same_v<T, float>)
    return static_cast<std::uint32_t>(candidate.key);
  else
    return candidate.index;
}
template <class T>
T distance_of(const Candidate<T>& candidate) {
  if constexpr (std::is_same_v<T, float>)
    return std::bit_cast<float>(static_cast<std::uint32_t>(candidate.key >> 32));
  else
    return candidate.distance;
}

/// By more than a few roundings.
template <class T>
T widened(T distance) {
  return distance * (1 + 32 * std::numeric_limits<T>::epsilon()) + std::numeric_limits<T>::min();
}

/// Sorts candidates whose distances are at most a bound.
template <class T>
class CandidateSort {
 public:
  void operator()(std::vector<Candidate<T>>& candidates, T bound) {
    // As many buckets as candidates: on a surface the squares of distances are spread evenly.
    const std::size_t buckets = candidates.size();
    const T scale = static_cast<T>(buckets) / bound;
    if (buckets > most || !(scale > 0 && scale < std::numeric_limits<T>::infinity())) {
      std::sort(candidates.begin(), candidates.end());
      return;
    }
    begin_.assign(buckets + 1, 0);
    bucket_.clear();
    for (const Candidate<T>& candidate : candidates) {
      bucket_.push_back(std::min(static_cast<std::size_t>(distance_of<T>(candidate) * scale), buckets - 1));
      ++begin_[bucket_.back() + 1];
    }
    for (std::size_t i = 0; i < buckets; ++i) begin_[i + 1] += begin_[i];
    sorted_.resize(candidates.size());
    for (std::size_t i = 0; i < candidates.size(); ++i) sorted_[begin_[bucket_[i]]++] = candidates[i];
    for (std::size_t i = 1; i < sorted_.size(); ++i) {
      const Candidate<T> candidate = sorted_[i];
      std::size_t j = i;
      for (; j > 0 && candidate < sorted_[j - 1]; --j) sorted_[j] = sorted_[j - 1];
      sorted_[j] = candidate;
    }
    candidates.swap(sorted_);
  }

 private:
  static constexpr std::size_t most = 1024;  // should all share one
  std::vector<Candidate<T>> sorted_;
  std::vector<std::size_t> begin_, bucket_;
};

/// Collects the k least (distance, index), and some more up to a bound of the k-th distance. A result set of
/// nanoflann's.
template <class T>
class NearestSet {
 public:
  using DistanceType = T;
  explicit NearestSet(std::size_t k) : k_(k) { found_.reserve(4 * k_); }
  /// `self`: the point to leave out.
  void reset(std::uint32_t self, T bound) {
    found_.clear();
    self_ = self;
    bound_ = bound;
  }
  bool full() const { return found_.size() >= k_; }
  bool addPoint(T distance, std::uint32_t index) {
    if (!(distance <= bound_) || index == self_) return true;
    found_.emplace_back(Candidate<T>{distance, index});
    if (found_.size() == 4 * k_) cut();
    return true;
  }
  /// Widened, so that the tree's rounded bounds never prune a tie.
  T worstDist() const { return widened(bound_); }
  /// In order; the first k are the least.
  const std::vector<Candidate<T>>& finish() {
    sort_(found_, bound_);
    return found_;
  }

 private:
  void cut() {
    std::nth_element(found_.begin(), found_.begin() + static_cast<std::ptrdiff_t>(k_ - 1), found_.end());
    found_.resize(k_);
    bound_ = distance_of<T>(found_.back());
  }

  const std::size_t k_;
  std::uint32_t self_ = 0;
  T bound_ = 0;
  std::vector<Candidate<T>> found_;
  CandidateSort<T> sort_;
};

/// Bounds the k-th distance of a query by those of the queries before it: where k points lie within r of q,
/// they lie within r + |q − p| of p. If p is one of them and left out, q itself takes its place.
template <class T>
class RecentQueries {
 public:
  /// Bound on the squared distance from p to its k-th neighbour; infinite without queries.
  T bound(const T* p) const {
    const Row squares = (x_ - p[0]).square() + (y_ - p[1]).square() + (z_ - p[2]).square();
    T least = std::numeric_limits<T>::infinity();
    // Eigen's root of a float is 0 for the smallest numbers and NaN for an infinite one.
    for (int i = 0; i < count; ++i) least = std::min(least, radius_[i] + std::sqrt(squares[i]));
    return widened(least * least);
  }
  void add(const T* q, T squared_radius) {
    x_[next_] = q[0], y_[next_] = q[1], z_[next_] = q[2];
    radius_[next_] = std::sqrt(squared_radius);
    next_ = (next_ + 1) % count;
  }

 private:
  static constexpr int count = 16;
  using Row = Lanes<T, count>;
  Row x_ = Row::Zero(), y_ = Row::Zero(), z_ = Row::Zero();
  Row radius_ = Row::Constant(std::numeric_limits<T>::infinity());
  int next_ = 0;
};

}  // namespace bitr::cpu
