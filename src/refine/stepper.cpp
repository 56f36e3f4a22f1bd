#include "refine/stepper.hpp"

#include "refine/transport.hpp"

namespace bitr::refine {

namespace {
constexpr std::size_t grain = 256;
}

void find(const Search& search, const Workers& workers) {
  workers.parallel_for(search.count, grain, [&](std::size_t begin, std::size_t end) {
    std::uint32_t index[Search::most_wanted];
    double squared[Search::most_wanted];
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3d point = search.point(i);
      search.take(i, index, squared, search.tree.knnSearch(point.data(), search.wanted, index, squared));
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
