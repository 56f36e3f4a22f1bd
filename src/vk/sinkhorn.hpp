// Sinkhorn's iterations for many transport plans together (shaders/common/transport_plan.glsl): a plan is
// never stored, memory is linear in the points.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "vk/submitter.hpp"

namespace bitr::vk {

class Sinkhorn {
 public:
  static constexpr std::uint32_t block = 64;  ///< neighbours that come with a box
  /// A cloud may have so many, or an invocation would loop longer than some drivers let it.
  static constexpr std::size_t most_points = 400'000;
  /// Bound on |slack|, which no potential exceeds by much: terms that matter then have squared distances
  /// whose coarse parts add up exactly.
  static constexpr double most_slack = 8000;
  /// Two points may be so far apart, or single precision does not place them well enough.
  static constexpr double most_distance = 1000;

  /// P = exp(u + v − |x − y|²); a row's or a column's slack is exp(u − slack), exp(v − slack).
  struct Problem {
    std::uint32_t sources = 0, references = 0;
    double slack = 0;
    double tolerance = 0;  ///< it stops when Σ |change of P| is less
  };

  explicit Sinkhorn(const Context& context);

  /// `normals`: of all problems or none.
  void lay_out(std::span<const Problem> problems, bool normals);
  // After lay_out(), before run(), to be filled:
  float* sources(std::size_t problem) const { return points(places_[problem].source); }
  float* references(std::size_t problem) const { return points(places_[problem].reference); }
  std::size_t numbers_per_point() const { return normals_ ? 8 : 4; }  ///< xyz, 0, the normal, 0
  /// Eight numbers per block of 64 points: low corner, 0, high corner, 0.
  float* source_boxes(std::size_t problem) const { return boxes(places_[problem].source); }
  float* reference_boxes(std::size_t problem) const { return boxes(places_[problem].reference); }
  /// The potential with which a reference point begins.
  void set_potential(std::size_t problem, std::uint32_t reference, double value);

  void run(int most_iterations);
  // After run():
  int iterations(std::size_t problem) const;
  /// Eight numbers per source: Σ P, Σ P (y − x), the same of the normals, 0.
  const float* moments(std::size_t problem) const;
  double potential(std::size_t problem, std::uint32_t reference) const;

  std::size_t bytes() const { return staging_.size() + arena_.size() + readback_.size(); }

 private:
  struct Place {
    std::uint32_t source, reference;  // first rows
  };
  struct Part {
    std::size_t begin = 0, bytes = 0;
  };
  float* points(std::uint32_t row) const;
  float* boxes(std::uint32_t row) const;
  float* block_record(std::uint32_t row) const;
  Range on_device(const Part& part) const { return {arena_.handle(), part.begin, part.bytes}; }
  void add_iteration(Schedule& schedule, std::uint32_t iteration) const;
  template <class Record>
  void by_tiles(std::size_t tiles, const Record& record) const;

  const Context& context_;
  std::vector<Problem> problems_;
  std::vector<Place> places_;
  bool normals_ = false;
  std::uint32_t rows_ = 0;
  std::size_t source_tiles_ = 0, reference_tiles_ = 0;
  double tile_cost_ = 0;
  // Parts of the staging buffer and of the arena alike; potentials have a second half in the arena, then come
  // the moments.
  Part tiles_[2], plans_, points_, boxes_, blocks_, states_, potentials_;
  Part all_potentials_, moments_;
  std::size_t uploaded_ = 0;
  int most_ = 0;
  Buffer staging_, arena_, readback_;
  Submitter submitter_;
};

}  // namespace bitr::vk
