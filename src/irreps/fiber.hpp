// Fibers: how many channels of each degree a feature has, and where they lie in a row.
#pragma once

#include <bitr/degree.hpp>
#include <cstddef>
#include <initializer_list>
#include <map>
#include <utility>

namespace bitr::irreps {

using bitr::Degree;

/// Channels per degree, in sorted order of (p, q). A row of features holds, degree after degree, channels ×
/// dim numbers (channel slow, component fast).
class Fiber {
 public:
  using Map = std::map<Degree, int>;

  Fiber() = default;
  Fiber(std::initializer_list<Map::value_type> parts) : parts_(parts) {}
  explicit Fiber(Map parts) : parts_(std::move(parts)) {}

  bool operator==(const Fiber&) const = default;
  auto begin() const { return parts_.begin(); }
  auto end() const { return parts_.end(); }
  std::size_t degrees() const { return parts_.size(); }
  bool has(Degree d) const { return parts_.count(d) != 0; }
  /// 0 for a degree that is absent.
  int channels(Degree d) const {
    const auto it = parts_.find(d);
    return it == parts_.end() ? 0 : it->second;
  }
  /// Numbers in a row.
  int size() const {
    int total = 0;
    for (const auto& [d, m] : parts_) total += m * d.dim();
    return total;
  }
  /// Where the block of degree d starts in a row.
  int offset(Degree d) const {
    int total = 0;
    for (const auto& [e, m] : parts_) {
      if (!(e < d)) break;
      total += m * e.dim();
    }
    return total;
  }
  /// Σ dim(d), channels not counted: the scale of the attention logits.
  int component_count() const {
    int total = 0;
    for (const auto& [d, m] : parts_) total += d.dim();
    return total;
  }
  void set(Degree d, int channels) { parts_[d] = channels; }

 private:
  Map parts_;
};

/// Channels of both, degree by degree (a's first): the fiber of concatenated features.
inline Fiber concatenate(const Fiber& a, const Fiber& b) {
  Fiber sum = a;
  for (const auto& [d, m] : b) sum.set(d, sum.channels(d) + m);
  return sum;
}

/// `fiber` with only the degrees that `keep` has.
inline Fiber restrict_to(const Fiber& fiber, const Fiber& keep) {
  Fiber::Map parts;
  for (const auto& [d, m] : fiber)
    if (keep.has(d)) parts[d] = m;
  return Fiber(std::move(parts));
}

}  // namespace bitr::irreps
