// A refinement as steps: it says what it has to know next, is told, and goes on. Whoever drives it finds that
// out, for one pair after the other on the CPU or for many together on a Vulkan device.
#pragma once

#include <bitr/cloud.hpp>
#include <cstdint>
#include <functional>
#include <vector>

#include "core/point_tree.hpp"
#include "refine/workers.hpp"

namespace bitr::refine {

/// Points that look for their nearest in a cloud.
struct Search {
  const std::vector<Vec3d>& in;
  const PointTree& tree;   ///< holds `in`
  const void* from;        ///< the same for points that differ from earlier ones by a rigid motion only
  std::size_t count = 0;   ///< how many points look
  std::size_t wanted = 1;  ///< how many nearest each wants, 1 or most_wanted
  static constexpr std::size_t most_wanted = 16;

  std::function<Vec3d(std::size_t)> point;  ///< where the i-th looks from
  /// Told, for every i, from any thread: rows of the nearest and their squared distances, `found` of each,
  /// nearest first. The distances may be written over.
  std::function<void(std::size_t i, const std::uint32_t* index, double* squared, std::size_t found)> take;
};

struct PlanWanted;

struct Wanted {
  std::vector<Search> searches;
  PlanWanted* plan = nullptr;  ///< refine/transport.hpp
  bool nothing() const { return searches.empty() && !plan; }
};

class Stepper {
 public:
  virtual ~Stepper() = default;
  /// What the next step needs; nothing when there is none to come.
  virtual Wanted wanted() = 0;
  /// After all that was wanted is there.
  virtual void step() = 0;
};

/// Looks from one place: rows and squared distances of at least one and at most `wanted`; returns how many.
std::size_t nearest(const Search& search, const Vec3d& from, std::uint32_t* index, double* squared);
/// Answers one search on the CPU.
void find(const Search& search, const Workers& workers);
/// To its end, on the CPU.
void drive(Stepper& stepper, const Workers& workers);

}  // namespace bitr::refine
