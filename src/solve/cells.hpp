// Points in cubes of space, found by place: what lies near a point without a tree.
#pragma once

#include <bitr/cloud.hpp>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace bitr::solving {

/// A hash table from a cube of side `side` to the points put in it. Which cubes there are depends on the frame,
/// what within() finds does not.
class Cells {
 public:
  /// Room for `points`. side > 0.
  Cells(double side, std::size_t points) : side_(side) {
    std::size_t places = 16;
    while (places < 2 * points) places *= 2;
    heads_.assign(places, none);
    keys_.assign(places, 0);
  }

  void add(const Vec3d& point, std::uint32_t index) {
    const std::uint64_t key = key_of(cube(point[0]), cube(point[1]), cube(point[2]));
    const std::size_t place = find(key);
    keys_[place] = key;
    entries_.push_back({point, index, heads_[place]});
    heads_[place] = static_cast<std::uint32_t>(entries_.size() - 1);
  }

  /// Calls visit(index, squared distance) for every point no farther than `side`, until it returns false.
  template <class Visit>
  void within(const Vec3d& from, const Visit& visit) const {
    const std::int64_t x = cube(from[0]), y = cube(from[1]), z = cube(from[2]);
    const double most = side_ * side_;
    // The middle cube first: it answers most questions.
    static constexpr int order[3] = {0, -1, 1};
    for (const int i : order)
      for (const int j : order)
        for (const int k : order)
          for (std::uint32_t e = heads_[find(key_of(x + i, y + j, z + k))]; e != none; e = entries_[e].next) {
            const Entry& entry = entries_[e];
            const double dx = entry.point[0] - from[0], dy = entry.point[1] - from[1],
                         dz = entry.point[2] - from[2];
            const double squared = dx * dx + dy * dy + dz * dz;
            if (squared <= most && !visit(entry.index, squared)) return;
          }
  }

 private:
  struct Entry {
    Vec3d point;
    std::uint32_t index, next;
  };
  static constexpr std::uint32_t none = UINT32_MAX;

  std::int64_t cube(double x) const { return static_cast<std::int64_t>(std::floor(x / side_)); }
  /// Never 0. Cubes 2²¹ apart share one, which costs time and nothing else.
  static std::uint64_t key_of(std::int64_t x, std::int64_t y, std::int64_t z) {
    constexpr std::uint64_t mask = (1 << 21) - 1;
    const auto part = [&](std::int64_t c) { return static_cast<std::uint64_t>(c) & mask; };
    return (part(x) | part(y) << 21 | part(z) << 42) + 1;
  }
  /// Where the key is, or the empty place where it would be.
  std::size_t find(std::uint64_t key) const {
    const std::size_t mask = heads_.size() - 1;
    std::size_t place = (key * 0x9e3779b97f4a7c15ull) >> 20 & mask;
    while (keys_[place] != key && keys_[place] != 0) place = (place + 1) & mask;
    return place;
  }

  double side_;
  std::vector<std::uint32_t> heads_;
  std::vector<std::uint64_t> keys_;
  std::vector<Entry> entries_;
};

}  // namespace bitr::solving
