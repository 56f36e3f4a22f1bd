#include "refine/stepper.hpp"

#include <limits>

#include "refine/transport.hpp"

namespace bitr::refine {

namespace {
constexpr std::size_t grain = 256;
}

std::size_t nearest(const Search& search, const Vec3d& from, std::uint32_t* index, double* squared) {
  const std::size_t found = search.tree.knnSearch(from.data(), search.wanted, index, squared);
  if (found > 0) return found;
  // So far away that the square overflows: any point is as near as another.
  *index = 0;
  *squared = std::numeric_limits<double>::max();
  return 1;
}

void find(const Search& search, const Workers& workers) {
  workers.parallel_for(search.count, grain, [&](std::size_t begin, std::size_t end) {
    std::uint32_t index[Search::most_wanted];
    double squared[Search::most_wanted];
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3d point = search.point(i);
      search.take(i, index, squared, nearest(search, point, index, squared));
    }
  });
}

void drive(Stepper& stepper, const Workers& workers) {
  for (Wanted wanted = stepper.wanted(); !wanted.nothing(); wanted = stepper.wanted()) {
    for (const Search& search : wanted.searches) find(search, workers);
    if (wanted.plan) solve(*wanted.plan);
    stepper.step();
  }
}

}  // namespace bitr::refine
